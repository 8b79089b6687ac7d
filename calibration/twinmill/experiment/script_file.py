# SPDX-License-Identifier: Apache-2.0
"""The script as the firmware and the twin read it."""

from twinmill.experiment.foresight import Rows


def csv_text(rows: Rows) -> str:
    """Rows `t_s,fl_pct,fr_pct,rl_pct,rr_pct`, each held until the next; the last one stops."""
    lines = ["t_s,fl_pct,fr_pct,rl_pct,rr_pct"]
    for t_s, duty in zip(rows.t_s, rows.duty, strict=True):
        lines.append(",".join([f"{t_s:.3f}", *(f"{100 * d:.0f}" for d in duty + 0.0)]))
    return "\n".join([*lines, f"{rows.end_s:.3f},0,0,0,0", ""])
