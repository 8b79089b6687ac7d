# SPDX-License-Identifier: Apache-2.0
"""The camera's bit: predicted from measured poses, compared with what robots reported."""
