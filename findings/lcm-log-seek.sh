#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# LCM 1.5.3: after a seek to a time the next event of a log may be older than that time.
#
# Guess: seek_to_timestamp(t) is followed by the first event at t or later, and beyond the last event by None.
# Seen, in an ordered log of an event each millisecond: in half of the seeks the next event is older, by up
#   to one event: a part of a run that is cut out by two seeks has one event too many, or one too few. Beyond
#   the last event it raises SystemError from an OSError whose number is 0, "Error".
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet lcm==1.5.3
cd "$work"
"$work/venv/bin/python" - <<'PY'
import lcm

log = lcm.EventLog("run.lcmlog", "w")
for k in range(1000):
    log.write_event(1000 * k, "POSE" if k % 2 else "TELEMETRY", bytes(10 + k % 90))
log.close()
log, late_us = lcm.EventLog("run.lcmlog", "r"), []
for at_us in range(0, 999_000, 777):
    log.seek_to_timestamp(at_us)
    late_us.append(log.read_next_event().timestamp - at_us)
older = sum(late < 0 for late in late_us)
print(f"{older} of {len(late_us)} older than asked for, by up to {-min(late_us)} us; newest {max(late_us)} us")
assert 0.4 < older / len(late_us) < 0.6 and -1000 < min(late_us) < -900
log.seek_to_timestamp(999_000)
assert log.read_next_event().timestamp == 999_000
try:
    log.seek_to_timestamp(999_001)
    raise SystemExit("a seek beyond the end raises nothing")
except (SystemError, OSError) as error:
    print(type(error).__name__, error)
PY
