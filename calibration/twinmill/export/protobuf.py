# SPDX-License-Identifier: Apache-2.0
"""Our message types as Protocol Buffers, which Foxglove reads with NaN and all."""

from functools import cache
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

FIELD = descriptor_pb2.FieldDescriptorProto
KINDS = {int: FIELD.TYPE_INT64, float: FIELD.TYPE_DOUBLE, str: FIELD.TYPE_STRING}


def to_protobuf(message: Any) -> Any:
    """A message of the package turbopi with the same fields: integers as int64, reals as double."""
    fields = {name: getattr(message, name) for name in message.__slots__}
    return _protobuf_type(type(message))(**fields)


@cache
def _protobuf_type(kind: type) -> type:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"turbopi/{kind.__name__}.proto", package="turbopi", syntax="proto3"
    )
    described, neutral = file.message_type.add(name=kind.__name__), kind()
    for number, name in enumerate(kind.__slots__, start=1):
        value = getattr(neutral, name)
        is_array = isinstance(value, list)
        described.field.add(
            name=name,
            number=number,
            type=KINDS[type(value[0] if is_array else value)],
            label=FIELD.LABEL_REPEATED if is_array else FIELD.LABEL_OPTIONAL,
        )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"turbopi.{kind.__name__}"))
