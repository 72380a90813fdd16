"""Orbit mean-elements messages of CCSDS 502 as they are written: JSON, XML, CSV and KVN, to keys and texts.

What a message says is `pointing.elements`' matter; here each is cut out by itself, so that one that is damaged costs
the others nothing.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple
from xml.parsers import expat

VERSION = "CCSDS_OMM_VERS"
_OMM = re.compile(r"<((?:[\w.-]+:)?)omm[\s>].*?(?:</\1omm\s*>|(?=<\1omm[\s>])|\Z)", re.DOTALL)
_PAIR = re.compile(r"([A-Za-z0-9_]+)\s*=\s*(.*?)\s*(?:\[([^\]]*)\])?")


class Message(NamedTuple):
    """One message: where it stands, its keys (upper case) with their texts and units, or why it cannot be read."""

    where: str
    values: dict[str, str]
    units: dict[str, str]
    fault: str = ""


def messages_of(text: str) -> list[Message] | None:
    """Return the messages in a text; None if it holds none of the four forms."""
    start = text.lstrip()[:1]
    if start == "<":
        return list(_xml(text))
    if start and start in "[{" and '"' in text:
        return list(_json(text))
    lines = [line for line in text.splitlines() if line.strip()]
    if any(re.match(r"\s*CCSDS_\w+_VERS\s*=|\s*MEAN_MOTION\s*=", line) for line in lines):
        return list(_kvn(text))
    if lines and "MEAN_MOTION" in lines[0].upper() and "," in lines[0]:
        return list(_csv(text))
    return None


def _json(text: str) -> Iterator[Message]:
    """Cut out object after object, so that what follows a damaged one is still read."""
    decoder = json.JSONDecoder(parse_float=str, parse_int=str, parse_constant=str)
    at, number = text.find("{"), 0
    while at >= 0:
        number += 1
        where = f"message {number}"
        try:
            found, end = decoder.raw_decode(text, at)
            cut = [_flat(one) for one in _objects(found)]
            number += len(cut) - 1
            yield from (Message(f"message {number - len(cut) + 1 + i}", *one) for i, one in enumerate(cut))
        except (ValueError, RecursionError) as error:
            line = text.count("\n", 0, at) + 1
            reason = error.msg if isinstance(error, json.JSONDecodeError) else "nested too deeply"
            yield Message(where, _salvaged(text, at), {}, f"damaged JSON in the object of line {line}: {reason}")
            end = _next_object(text, at)
        at = text.find("{", end)


def _salvaged(text: str, at: int) -> dict[str, str]:
    """Return the name in a damaged object, so that the reason can say whose it is."""
    end = _next_object(text, at)
    match = re.search(r'"OBJECT_NAME"\s*:\s*"([^"]{1,80})"', text[at:end])
    return {"OBJECT_NAME": match[1]} if match else {}


def _next_object(text: str, at: int) -> int:
    """Return where the object after a damaged one begins: behind a brace that closes it, or at the next that opens."""
    match = re.compile(r"\}\s*,?\s*(?=\{)|(?<=[,\s])(?=\{)").search(text, at + 1)
    return len(text) if match is None else match.end()


def _objects(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the messages in one object: itself, or those of the lists in it."""
    inner: list[dict[str, Any]] = []
    for v in found.values():
        if isinstance(v, dict):
            below = _objects(v)
            inner += below if below != [v] else []
        elif isinstance(v, list) and v and all(isinstance(one, dict) for one in v):
            inner += [message for one in v for message in _objects(one)]
    return inner or [found]


def _flat(found: dict[str, Any]) -> tuple[dict[str, str], dict[str, str], str]:
    """Return the keys of a message and of the objects in it (header, metadata, mean elements), and a fault."""
    values: dict[str, str] = {}
    fault = ""
    for key, value in found.items():
        name = key.upper()
        if isinstance(value, str):
            values[name] = value
        elif isinstance(value, dict):
            inner, _, wrong = _flat(value)
            values |= inner
            fault = fault or wrong
        elif value is not None and name not in ("COMMENT", "COMMENTS", "USER_DEFINED"):
            fault = fault or f"{key[:40]!a} is neither a text nor a number"
    return values, {}, fault


def _csv(text: str) -> Iterator[Message]:
    rows = csv.reader(io.StringIO(text))
    try:
        header = [name.strip().upper() for name in next(rows)]
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            where = f"line {rows.line_num}"
            values = {key: cell.strip() for key, cell in zip(header, row, strict=False)}
            fault = "" if len(row) == len(header) else f"{len(row)} columns, {len(header)} are named in the first line"
            yield Message(where, values, {}, fault)
    except csv.Error as error:
        yield Message(f"line {rows.line_num}", {}, {}, f"not CSV from here on: {error}")


def _kvn(text: str) -> Iterator[Message]:
    """Cut at every version line; a message that lacks its own begins where the first key stands."""
    values: dict[str, str] = {}
    units: dict[str, str] = {}
    first, fault = 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or re.match(r"COMMENT\b", line):
            continue
        match = _PAIR.fullmatch(line)
        key = match[1].upper() if match else ""
        if re.fullmatch(r"CCSDS_\w+_VERS", key):
            if first:
                yield Message(f"line {first}", values, units, fault)
            values, units, first, fault = {}, {}, number, ""
            if key != VERSION:
                fault = f"{key}: no orbit mean-elements message"
        first = first or number
        if match is None:
            fault = fault or f"line {number} is not KEY = VALUE"
        elif key in values and not key.startswith("USER_DEFINED"):
            fault = fault or f"line {number}: {key} comes twice"
        else:
            values[key] = match[2]
            if match[3] is not None:
                units[key] = match[3]
    if first:
        yield Message(f"line {first}", values, units, fault)


def _xml(text: str) -> Iterator[Message]:
    """Parse each <omm> by itself. A document type, and with it every entity of its own, is refused as a whole."""
    if re.search(r"<!(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        yield Message("XML", {}, {}, "it declares a document type: entities are not read")
        return
    number = 0
    for number, match in enumerate(_OMM.finditer(text), start=1):
        values: dict[str, str] = {}
        units: dict[str, str] = {}
        where = f"message {number} (line {text.count(chr(10), 0, match.start()) + 1})"
        try:
            _parse(match[0], match[1], values, units)
            yield Message(where, values, units)
        except (expat.ExpatError, ValueError) as error:
            yield Message(where, values, units, f"damaged XML: {error}")
    if not number:
        yield Message("XML", {}, {}, "no <omm> in it")


def _parse(text: str, prefix: str, values: dict[str, str], units: dict[str, str]) -> None:
    """Fill in the leaves of one <omm> by their local names."""
    parser = expat.ParserCreate()
    held: list[str] = []
    depth = leaf = 0

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, leaf
        depth += 1
        leaf = depth
        held.clear()
        if "units" in attributes:
            units[name.rpartition(":")[2].upper()] = attributes["units"]

    def end(name: str) -> None:
        nonlocal depth
        key = name.rpartition(":")[2].upper()
        if depth == leaf and key not in ("COMMENT", "USER_DEFINED"):
            if key in values:
                raise ValueError(f"<{key[:40]}> comes twice")
            values[key] = "".join(held).strip()
        depth -= 1

    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    parser.CharacterDataHandler = held.append
    parser.buffer_text = True
    parser.Parse(text, True)
