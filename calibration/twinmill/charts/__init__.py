# SPDX-License-Identifier: Apache-2.0
"""Charts in a browser: floor and series with one cursor, in the workbench and in reports."""
