# SPDX-License-Identifier: Apache-2.0
"""The files of a model's ranges: YAML, JSON and NumPy's."""

import io
import json
from typing import Any

import numpy as np

from twinmill.extras import needing
from twinmill.model.ranges import Ranges


def as_yaml(data: dict[str, Any]) -> str:
    """Rows of numbers one a line."""
    with needing("export"):
        import yaml
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=10_000)


def as_json(data: dict[str, Any]) -> str:
    """The ranges as one line of JSON."""
    return json.dumps(data, allow_nan=False) + "\n"


def as_npz(found: Ranges) -> bytes:
    """Arrays by the names of the JSON's fields; `truncated` holds names."""
    stream = io.BytesIO()
    intervals = np.array([q.interval for q in found.quantities])
    np.savez(
        stream,
        names=np.array([q.name for q in found.quantities]),
        units=np.array([q.unit for q in found.quantities]),
        value=np.array([q.value for q in found.quantities]),
        std=np.array([q.std for q in found.quantities]),
        low=intervals[:, 0],
        high=intervals[:, 1],
        covariance=found.covariance,
        samples=found.samples,
        truncated=np.array([q.name for q in found.truncated], str),
    )
    return stream.getvalue()
