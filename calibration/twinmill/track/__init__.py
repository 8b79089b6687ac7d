# SPDX-License-Identifier: Apache-2.0
"""Poses of tagged robots from one camera over the floor: OpenCV finds tags, geometry is ours."""
