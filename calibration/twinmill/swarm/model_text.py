# SPDX-License-Identifier: Apache-2.0
"""A model file's text with other numbers, another effect, or a robot that differs."""

from collections.abc import Mapping

import tomlkit
import twinmill_native as native

from twinmill.model.parameters import effect_names


def with_values(text: str, model: native.Model, values: Mapping[str, float]) -> str:
    """The text with these numbers under their full names, as `base.yaw_gain`.

    Args:
        text: of the model file.
        model: read from it.
        values: by name; of effects those that the model has, `dead_zone#2.width` included.
    """
    document = tomlkit.parse(text)
    effects = effect_names(model)
    for name, value in values.items():
        section, *key = name.split(".")
        if section in effects:
            table = document["effect"][effects.index(section)]
        else:
            table = document.setdefault(section, tomlkit.table())
        if len(key) == 2:
            table[key[0]][int(key[1])] = float(value)
        else:
            table[key[0]] = float(value)
    return tomlkit.dumps(document)


def with_effect(text: str, effect: str, values: Mapping[str, float]) -> str:
    """The text with one more effect."""
    document = tomlkit.parse(text)
    table = tomlkit.table()
    table.update({"name": effect, **{key: float(value) for key, value in values.items()}})
    document.setdefault("effect", tomlkit.aot()).append(table)
    return tomlkit.dumps(document)


def with_robot(text: str, robot_id: int, effect: str | None, values: Mapping[str, float]) -> str:
    """The text with numbers of one robot's own: of an effect that the model has, or its gains."""
    document = tomlkit.parse(text)
    robots = document.setdefault("robots", tomlkit.table(is_super_table=True))
    place = robots.setdefault(f"R{robot_id:02d}", tomlkit.table())
    if effect is not None:
        place = place.setdefault(effect, tomlkit.inline_table())
    place.update({key: float(value) for key, value in values.items()})
    return tomlkit.dumps(document)


def for_all_robots(text: str, effect: str) -> str:
    """The text without what single robots have of an effect of their own."""
    document = tomlkit.parse(text)
    for own in document.get("robots", {}).values():
        own.pop(effect, None)
    return tomlkit.dumps(document)
