#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# SciPy 1.17.1: sparse.block_diag of dense arrays stores all their zeros.
#
# Guess: a sparse matrix that SciPy makes of dense arrays holds what is not zero, as csr_array(dense) does.
# Seen: of two bands of 1,000 by 1,000 with one diagonal each it stores 2,000,000 numbers, not 2,000, and the
#   conversion to csr keeps them, so that its products cost as dense ones. Of csr_array(dense) for each block
#   it stores 2,000; eliminate_zeros() takes the others away.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import numpy as np
from scipy import sparse

band = np.eye(1000)
dense = sparse.block_diag([band, band], format="csr")
own = sparse.block_diag([sparse.csr_array(band)] * 2, format="csr")
stored = [sparse.csr_array(band).nnz, dense.nnz, sparse.csr_array(dense).nnz, own.nnz]
dense.eliminate_zeros()
print("csr_array of one block {}, block_diag of two {}, as csr_array {}, of sparse ones {}".format(*stored))
assert stored == [1000, 2_000_000, 2_000_000, 2000] and dense.nnz == 2000
PY
