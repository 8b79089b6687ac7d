# SPDX-License-Identifier: Apache-2.0
"""MCAP of protobuf messages, read by Foxglove's two libraries."""

import json
import subprocess
from pathlib import Path

from interop import drive
from interop.cells import Cell, Told, writes

FILE = "drive.mcap"
POSE = "R01_POSE"
READ = """
const fs = require("fs/promises");
const { McapIndexedReader } = require("@mcap/core");
(async () => {
  const file = await fs.open(process.argv[1]);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      await file.read(buffer, 0, Number(length), Number(offset));
      return buffer;
    },
  };
  const { loadDecompressHandlers } = require("@mcap/support");
  const decompressHandlers = await loadDecompressHandlers();
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const stamps = [];
  for await (const message of reader.readMessages({ topics: [process.argv[2]] }))
    stamps.push(String(message.logTime));
  const schemas = [...reader.schemasById.values()].map((s) => [s.name, s.encoding]);
  console.log(JSON.stringify({ stamps, schemas, chunks: reader.chunkIndexes.length }));
})();
"""


def _write(folder: Path) -> None:
    drive.export(folder, "mcap", FILE)


@writes(
    "MCAP",
    "mcap, with protobuf support",
    "mcap==1.6.0",
    "mcap-protobuf-support==0.6.0",
    ours=_write,
)
def python(folder: Path) -> Told:
    """Foxglove's library for Python; the types are those in the file."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with (folder / FILE).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        rows = [
            (message.log_time, decoded)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=[POSE])
        ]
        frames = sum(
            1
            for schema, _, _, _ in reader.iter_decoded_messages()
            if schema.name == "foxglove.FrameTransform"
        )
    return {
        "stamps": [at // 1000 for at, _ in rows]
        == [drive.START_US + k * drive.STEP_US for k in range(drive.COUNT)],
        "fields": all(
            abs(m.position_m[0] - drive.x_m(k)) < 1e-9
            for k, (_, m) in enumerate(rows)
            if drive.seen(k)
        ),
        "lost poses": [bool(m.valid) for _, m in rows]
        == [drive.seen(k) for k in range(drive.COUNT)],
        "frames for a 3D view": frames == drive.COUNT - drive.LOST,
    }


@writes("MCAP", "@mcap/core for Node", "@mcap/core@2.2.2", "@mcap/support@1.1.0", ours=_write)
def node(folder: Path) -> Told:
    """Foxglove's other library, which the viewer has; it goes by the file's index."""
    command = ["node", "-e", READ, str(folder / FILE), POSE]
    done = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    return {
        "index of chunks": done["chunks"] > 0,
        "stamps": [int(at) // 1000 for at in done["stamps"]]
        == [drive.START_US + k * drive.STEP_US for k in range(drive.COUNT)],
        "types in the file": ["turbopi.pose_t", "protobuf"] in done["schemas"],
    }


NOT_RUN = [
    Cell("MCAP", "writes", "mcap CLI", why_not="neither Go's module proxy nor crates.io has it"),
]
