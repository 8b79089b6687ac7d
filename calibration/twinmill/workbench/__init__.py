# SPDX-License-Identifier: Apache-2.0
"""The workbench: logs and a model side by side in the browser, until they agree."""
