# SPDX-License-Identifier: Apache-2.0
"""A sweep on a Dask cluster of two machines, of which one dies: two networks joined by a cable.

Usage: cluster_session.py FOLDER, in a network of its own. Prints what happened as JSON.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from distributed import Client

from twinmill.swarm import request as request_module
from twinmill.swarm.store import Store
from twinmill.swarm.sweep import make_request, sweep

HERE, THERE, PORT = "10.77.0.1", "10.77.0.2", 8786
SCHEDULER = f"tcp://{HERE}:{PORT}"
DASK = (sys.executable, "-m", "distributed.cli.dask_worker", SCHEDULER, "--nthreads", "1")
WORKER = (*DASK, "--no-dashboard", "--nworkers", "2")
OTHER_MACHINE = (
    f"read cable && ip link set lo up && ip addr add {THERE}/24 dev there && "
    'ip link set there up && exec "$@"'
)


def other_machine() -> subprocess.Popen:
    """A worker in another network, at the other end of a cable."""
    command = ["unshare", "--net", "sh", "-c", OTHER_MACHINE, "sh", *WORKER]
    machine = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
    own = os.readlink("/proc/self/ns/net")
    while os.readlink(f"/proc/{machine.pid}/ns/net") == own:
        time.sleep(0.01)
    # This machine's address is not the cable's, which goes when the other machine does.
    for words in (
        "link add here type veth peer name there",
        f"link set there netns {machine.pid}",
        f"addr add {HERE}/32 dev lo",
        "link set here up",
        f"route add {THERE}/32 dev here src {HERE}",
    ):
        subprocess.run(["ip", *words.split()], check=True)
    machine.stdin.write(b"in\n")
    machine.stdin.close()
    return machine


def main(folder: Path) -> dict:
    """One sweep on this machine's threads and on the cluster, which loses a machine half way."""
    request_module.PART_BATCHED = 400_000
    asked = make_request("milling", "paper.toml", ["v_mps=0.1:0.3:20"], seeds=20, duration_s=60.0)
    sweep(asked, folder / "here")
    other = other_machine()
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", HERE]
    scheduler = subprocess.Popen([*command, "--port", str(PORT), "--no-dashboard"])
    worker = subprocess.Popen(WORKER)
    keep, kept, worked_at = Store.keep, [], set()

    def keep_and_kill(store: Store, number: int, columns: dict) -> None:
        keep(store, number, columns)
        kept.append(number)
        if len(kept) == 3:
            os.killpg(other.pid, signal.SIGKILL)

    try:
        with Client(SCHEDULER, timeout=30) as client:
            client.wait_for_workers(4, timeout=60)
            worked_at = {name.split("/")[2].split(":")[0] for name in client.run(os.getpid)}
            Store.keep = keep_and_kill
            sweep(asked, folder / "there", dask=SCHEDULER)
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait(20)
    files = [folder / place / "sweep.parquet" for place in ("here", "there")]
    return {
        "machines": sorted(worked_at),
        "parts": len(asked.parts()),
        "kept": len(kept),
        "died": other.wait(10),
        "same": files[0].read_bytes() == files[1].read_bytes(),
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
