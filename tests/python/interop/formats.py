# SPDX-License-Identifier: Apache-2.0
"""All cells, in the order of the table; a new format's module is named here."""

from interop import mjcf, sdf, urdf
from interop.cells import cells_of

CELLS = [cell for module in (mjcf, urdf, sdf) for cell in cells_of(module)]
