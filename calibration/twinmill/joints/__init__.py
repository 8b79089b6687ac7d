# SPDX-License-Identifier: Apache-2.0
"""Any robot of hinges and slides that MuJoCo can load: what its MJCF lacks, from a log.

`log` (arrays of a run), `mjcf` (the model, and changes of its text), `series` (states and commands
over steps), `states` (those by a run of the model), `action` (MuJoCo's inputs), `plant`
(accelerations by MuJoCo), `effects` (the catalogue), `dependences` (what has no name), `always`
(what the own log showed), `hook` (what MJCF cannot hold), `problem` (all of that for
`twinmill.inference`), `diagnose` and `explain` (the answer).
"""
