"""Strict TOML: unknown keys are named with the nearest known one, every error says file and key."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from boresight.errors import UserError, did_you_mean
from boresight.io.files import read_text

T = TypeVar("T")


class TableModel(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True, omit_defaults=True):
    """A table of a TOML file: units in the key names, no key but these."""


def read_toml(path: Path | str) -> dict[str, Any]:
    """Read a TOML file into plain values; raises UserError with the line of a syntax error."""
    path = Path(path)
    return toml_of(read_text(path), str(path))


def toml_of(text: str, where: str) -> dict[str, Any]:
    """Return the plain values of a TOML text, called `where` in errors; raises UserError."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{where}: not valid TOML: {error}") from None
    except RecursionError:
        raise UserError(f"{where}: not valid TOML: tables or lists are nested too deeply") from None


def convert(value: Any, model: type[T], where: str) -> T:
    """Convert plain values into a TableModel; raises UserError that names the key under `where`."""
    try:
        _check_keys(value, msgspec.inspect.type_info(model), where, "")
        return msgspec.convert(value, model)
    except RecursionError:
        raise UserError(f"{where}: tables or lists are nested too deeply") from None
    except msgspec.ValidationError as error:
        text, _, place = str(error).partition(" - at `$")
        key = place.rstrip("`").lstrip(".")
        text = re.sub("`", "", text[:1].lower() + text[1:])
        raise UserError(f"{where}: {_named(value, key)}: {text}" if key else f"{where}: {text}") from None


def _check_keys(value: Any, info: msgspec.inspect.Type, where: str, place: str) -> None:
    """Refuse unknown keys and NaN, depth first, before types are looked at."""
    if isinstance(value, float) and math.isnan(value):
        raise UserError(f"{where}: {place}: is NaN; give a number")
    if isinstance(info, msgspec.inspect.UnionType):
        info = next((t for t in info.types if isinstance(t, msgspec.inspect.StructType)), info)
    if isinstance(info, msgspec.inspect.StructType) and isinstance(value, dict):
        fields = {f.encode_name: f for f in info.fields}
        for key, inner in value.items():
            if key not in fields:
                at = f" in {place}" if place else ""
                raise UserError(f"{where}: unknown key '{key}'{at}{did_you_mean(key, fields)}")
            _check_keys(inner, fields[key].type, where, f"{place}.{key}" if place else key)
        for key, field in fields.items():
            if field.required and key not in value:
                raise UserError(f"{where}: key '{key}' is missing" + (f" in {place}" if place else ""))
    elif isinstance(value, list):
        item = getattr(info, "item_type", msgspec.inspect.AnyType())
        for i, inner in enumerate(value):
            name = inner.get("id", i) if isinstance(inner, dict) else i
            _check_keys(inner, item, where, f"{place}[{name!r}]" if isinstance(name, str) else f"{place}[{name}]")


def _named(value: Any, key: str) -> str:
    """Replace `sensor[0]` by `sensor['radar']` where that table has an id."""
    found = re.match(r"(\w+)\[(\d+)\]", key)
    if found and isinstance(value, dict):
        table = value[found[1]][int(found[2])]
        if isinstance(table, dict) and isinstance(table.get("id"), str):
            return f"{found[1]}['{table['id']}']{key[found.end() :]}"
    return key


def write_toml(value: dict[str, Any]) -> str:
    """Return TOML text of plain values: scalars first, then tables, then arrays of tables (one level deep)."""
    lines = [f"{k} = {_inline(v)}" for k, v in value.items() if not _is_table(v)]
    for key, table in value.items():
        if isinstance(table, dict):
            lines += ["", f"[{key}]"] + [f"{k} = {_inline(v)}" for k, v in table.items()]
        elif _is_table(table):
            for item in table:
                lines += ["", f"[[{key}]]"] + [f"{k} = {_inline(v)}" for k, v in item.items()]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def key(name: str) -> str:
    """Return a key as TOML writes it: quoted where it holds more than letters, digits, - and _."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _inline(name)


def _inline(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int):
        return repr(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    return "[" + ", ".join(_inline(v) for v in value) + "]"
