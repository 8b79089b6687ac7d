# SPDX-License-Identifier: Apache-2.0
"""The robot's decision on a frame against OpenCV, as used and as it could be, and against a copy.

All on one thread, in its processor time: waiting for other programs does not count.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import scene
from ratio import Ratio, paired, skipped

# As many as the camera has: no frame is still in the nearest cache when its turn comes again.
FRAMES = 4
DECISIONS = 16
REPETITIONS = 150


class Native:
    """The core and memcpy, through decision.c."""

    def __init__(self, build: Path) -> None:
        self._library = ctypes.CDLL(str(build / "benchmarks/libbench.so"))
        self._library.bench_decide_ns.restype = ctypes.c_int64
        self._library.bench_copy_ns.restype = ctypes.c_int64

    def decide_us(self, frames: np.ndarray, bits: int = 1) -> tuple[float, int]:
        """Time of one decision, and how many of DECISIONS saw the target."""
        seen = ctypes.c_int()
        took_ns = self._library.bench_decide_ns(
            frames.ctypes.data_as(ctypes.c_void_p),
            len(frames),
            bits,
            DECISIONS,
            ctypes.byref(seen),
        )
        return took_ns / DECISIONS / 1e3, seen.value

    def copy_us(self, frames: np.ndarray) -> float:
        """Time of one copy."""
        pointer = frames.ctypes.data_as(ctypes.c_void_p)
        return self._library.bench_copy_ns(pointer, len(frames), DECISIONS) / DECISIONS / 1e3


def measure(build: Path) -> Iterator[Ratio]:
    """All comparisons, on three scenes."""
    native = Native(build)
    yield from _against_copy(native)
    try:
        import cv2
        import peers
    except ImportError as error:
        yield skipped("OpenCV : decision", f"{error}: see benchmarks/requirements.txt")
        return
    cv2.setNumThreads(1)
    yield from _against_peer(native, peers.Peer())
    for name, sees in peers.CHAINS.items():
        yield _against_chain(native, name, sees)


def _ring(make: Callable[..., np.ndarray], *arguments: int) -> np.ndarray:
    return np.stack([make(seed, *arguments) for seed in range(FRAMES)])


def _against_copy(native: Native) -> Iterator[Ratio]:
    scenes = {
        "one robot": (_ring(scene.floor, 40), {"at_most": 3}),
        "no robot": (_ring(scene.floor), {"at_most": 3}),
        "random": (_ring(scene.noise), {}),
    }
    for name, (frames, goal) in scenes.items():
        pairs = [(native.copy_us(frames), native.decide_us(frames)[0]) for _ in range(REPETITIONS)]
        copies, decisions = np.transpose(pairs)
        yield paired(f"decision : memcpy, {name}", decisions, copies, "us", **goal)
    frames = _ring(scene.floor, 40)
    pairs = [[native.decide_us(frames, bits)[0] for bits in (4, 1)] for _ in range(REPETITIONS)]
    yield paired("4 bits : 1 bit, one robot", *np.transpose(pairs), "us")


def _against_peer(native: Native, peer: "peers.Peer") -> Iterator[Ratio]:  # noqa: F821
    frames = _ring(scene.floor, 40)
    decide, capture, loop = [], [], []
    for i in range(REPETITIONS):
        took_us, seen = native.decide_us(frames)
        decide.append(took_us)
        begin_s = time.thread_time()
        picture = peer.capture(frames[i % FRAMES])
        middle_s = time.thread_time()
        peer_sees = peer.sees(picture)
        peer.vote(peer_sees)
        end_s = time.thread_time()
        capture.append((middle_s - begin_s) * 1e6)
        loop.append((end_s - middle_s) * 1e6)
        if seen != DECISIONS or not peer_sees:
            raise ValueError("the robot in view was not seen: the two do not do the same work.")
    whole = np.add(capture, loop)
    yield paired("OpenCV : decision", whole, decide, "us", at_least=40)
    yield paired("OpenCV, part : decision", loop, decide, "us")


def _against_chain(native: Native, name: str, sees: Callable[[np.ndarray], bool]) -> Ratio:
    """Without vote and motions, to the chain's advantage."""
    frames, empty = _ring(scene.floor, 40), scene.floor(FRAMES)
    decide, chain = [], []
    for i in range(REPETITIONS):
        decide.append(native.decide_us(frames)[0])
        begin_s = time.thread_time()
        seen = sees(frames[i % FRAMES])
        chain.append((time.thread_time() - begin_s) * 1e6)
        if not seen:
            raise ValueError(f"{name}: the robot in view was not seen: it is not the same work.")
    if sees(empty):
        raise ValueError(f"{name}: a robot was seen where none is: it is not the same work.")
    return paired(f"OpenCV, {name} : decision", chain, decide, "us")
