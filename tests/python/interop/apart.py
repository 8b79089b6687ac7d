# SPDX-License-Identifier: Apache-2.0
"""One side of a cell in a process of its own: module, function and folder are the arguments."""

import importlib
import json
import sys
from pathlib import Path

module, function, folder = sys.argv[1:]
told = getattr(importlib.import_module(module), function)(Path(folder))
Path(folder, "told.json").write_text(json.dumps(told, default=bool))
