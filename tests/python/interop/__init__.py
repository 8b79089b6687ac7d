# SPDX-License-Identifier: Apache-2.0
"""Files between Twinmill and other programs: one module a format, one function a program."""
