# SPDX-License-Identifier: Apache-2.0
"""Version of all of Twinmill; the package's description takes it from here."""

__version__ = "0.1.0"
