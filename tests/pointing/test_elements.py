"""Mean elements in every form: each set by itself, what cannot be used refused with its reason."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import numpy as np
import pytest
from benchmarks.passes import lines_of

from boresight.errors import UserError
from boresight.pointing.elements import RefusedError, epoch_of, read_elements
from boresight.pointing.satellite import ecef_at

GOOD = {
    "OBJECT_NAME": "HELIOS", "OBJECT_ID": "2004-049A", "EPOCH": "2025-03-26T05:19:34.116960",
    "MEAN_MOTION": "15.00555103", "ECCENTRICITY": ".000583", "INCLINATION": "98.3164",
    "RA_OF_ASC_NODE": "103.8411", "ARG_OF_PERICENTER": "20.5667",
    "MEAN_ANOMALY": "339.5789", "EPHEMERIS_TYPE": "0", "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": "28492",
    "ELEMENT_SET_NO": "999", "REV_AT_EPOCH": "8655", "BSTAR": ".00048021", "MEAN_MOTION_DOT": ".00005995",
    "MEAN_MOTION_DDOT": "0",
}  # fmt: skip
UNITS = {"MEAN_MOTION": "rev/day", "INCLINATION": "deg", "BSTAR": "1/ER", "MEAN_MOTION_DOT": "rev/day**2"}
MEAN = {"EPOCH", "MEAN_MOTION", "ECCENTRICITY", "INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY"}
META = {"OBJECT_NAME", "OBJECT_ID"}


def as_json(*messages: dict[str, object]) -> str:
    return json.dumps(list(messages))


def as_csv(*messages: dict[str, str]) -> str:
    rows = [",".join(m.get(k, "") for k in GOOD) for m in messages]
    return "\n".join([",".join(GOOD), *rows]) + "\n"


def as_kvn(*messages: dict[str, str]) -> str:
    out = []
    for m in messages:
        out += ["CCSDS_OMM_VERS = 2.0", "COMMENT made here", "CREATION_DATE = 2025-085T06:00:00", "ORIGINATOR = X"]
        out += [f"{k:20s}= {v}" + (f" [{UNITS[k]}]" if k in UNITS else "") for k, v in m.items()]
        out += ["USER_DEFINED_NOTE = 1", "USER_DEFINED_NOTE = 2", ""]
    return "\r\n".join(out)


def as_xml(*messages: dict[str, str], ns: str = "") -> str:
    out = ['<?xml version="1.0" encoding="UTF-8"?>', f"<{ns}ndm>"]
    for m in messages:
        tags = {k: f"<{k}" + (f' units="{UNITS[k]}"' if k in UNITS else "") + f">{v}</{k}>" for k, v in m.items()}
        meta = "".join(v for k, v in tags.items() if k in META)
        mean = "".join(v for k, v in tags.items() if k in MEAN)
        rest = "".join(v for k, v in tags.items() if k not in META | MEAN)
        out.append(
            f'<{ns}omm id="CCSDS_OMM_VERS" version="2.0"><header><COMMENT>a</COMMENT><CREATION_DATE/></header><body>'
            f"<segment><metadata>{meta}</metadata><data><meanElements>{mean}</meanElements>"
            f"<tleParameters>{rest}</tleParameters></data></segment></body></{ns}omm>"
        )
    return "\n".join([*out, f"</{ns}ndm>"])


FORMS = {"json": as_json, "csv": as_csv, "kvn": as_kvn, "xml": as_xml}


def place(text: str, after: float = 3600.0) -> np.ndarray:
    (one,) = read_elements(text, "x")
    return ecef_at(one, one.epoch + after)[0]


def test_the_four_forms_say_the_same_as_sgp4s_own_reader() -> None:
    omm, api = pytest.importorskip("sgp4.omm"), pytest.importorskip("sgp4.api")
    record = api.Satrec()
    omm.initialize(record, GOOD)
    for name, form in FORMS.items():
        (one,) = read_elements(form(GOOD), "x")
        assert (one.name, one.number) == ("HELIOS", "28492"), name
        for minutes in (0.0, 90.0, 10_000.0):
            error, r, _ = one.record.sgp4_tsince(minutes)
            assert error == 0
            np.testing.assert_allclose(r, record.sgp4_tsince(minutes)[1], rtol=0, atol=1e-6)
        assert one.epoch == pytest.approx(datetime(2025, 3, 26, 5, 19, 34, 116960, UTC).timestamp(), abs=1e-4)
    np.testing.assert_array_equal(place(as_xml(GOOD, ns="ndm:")), place(as_xml(GOOD)))
    nested = {"header": {"ORIGINATOR": "X"}, "body": {"segment": {"metadata": {}, "data": {"meanElements": GOOD}}}}
    np.testing.assert_array_equal(place(json.dumps({"ndm": {"omm": [nested]}})), place(as_json(GOOD)))


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("2025-03-26T05:19:34", "2025-03-26T05:19:34.000000"),
        ("2025-03-26T05:19:34Z", "2025-03-26T05:19:34.000000"),
        ("2025-085T05:19:34.5", "2025-03-26T05:19:34.500000"),
        ("2024-366T23:59:59.25Z", "2024-12-31T23:59:59.250000"),
        ("2025-03-26T05:19:34.12345678", "2025-03-26T05:19:34.123457"),
        ("2016-12-31T23:59:60", "2017-01-01T00:00:00.000000"),
        ("2024-02-29T00:00:00.0", "2024-02-29T00:00:00.000000"),
        (" 2000-01-01T00:00:00 ", "2000-01-01T00:00:00.000000"),
    ],
)
def test_every_legal_epoch(text: str, same: str) -> None:
    days, fraction = epoch_of(text)
    meant = (datetime.fromisoformat(same) - datetime(1949, 12, 31)).total_seconds() / 86400.0
    assert days + fraction == pytest.approx(meant, abs=1e-10)
    for form in FORMS.values():
        (one,) = read_elements(form({**GOOD, "EPOCH": text}), "x")
        assert one.epoch == pytest.approx(datetime.fromisoformat(same).replace(tzinfo=UTC).timestamp(), abs=1e-4)


@pytest.mark.parametrize(
    "text",
    [
        "2025-02-29T00:00:00", "2025-366T00:00:00", "2025-000T00:00:00", "2025-13-01T00:00:00", "2025-03-26T24:00:00",
        "2025-03-26T05:60:00", "2025-03-26T05:19:60", "2025-03-26", "26.03.2025 05:19", "", "2025-03-26T05:19:34+01:00",
        "0000-01-01T00:00:00", "2025-03-26T05:19", "٢٠٢٥-03-26T05:19:34",
    ],
)  # fmt: skip
def test_no_epoch(text: str) -> None:
    with pytest.raises(RefusedError, match="EPOCH"):
        epoch_of(text)


@pytest.mark.parametrize("number", ["5", "28492", "A0001", "Z9999", "270000", "340001", "799501299", "1" * 40])
def test_a_catalogue_number_is_a_label(number: str) -> None:
    for form in FORMS.values():
        (one,) = read_elements(form({**GOOD, "NORAD_CAT_ID": number}), "x")
        assert one.number == number
    (one,) = read_elements(json.dumps({**GOOD, "NORAD_CAT_ID": 799501299}), "x")
    assert one.number == "799501299"


def test_what_may_be_left_out() -> None:
    few = {k: v for k, v in GOOD.items() if k in MEAN | {"BSTAR"}}
    for form in (as_json, as_kvn, as_xml):
        np.testing.assert_array_equal(place(form(few)), place(form(GOOD)))
    assert read_elements(as_json({**few, "OBJECT_NAME": None}), "x")[0].name == ""


BAD = {
    "SGP4-XP": {"EPHEMERIS_TYPE": "4"},
    "SDP8": {"EPHEMERIS_TYPE": "5"},
    "MEAN_ELEMENT_THEORY DSST": {"MEAN_ELEMENT_THEORY": "DSST"},
    "TIME_SYSTEM TAI": {"TIME_SYSTEM": "TAI"},
    "REF_FRAME EME2000": {"REF_FRAME": "EME2000"},
    "CENTER_NAME MARS": {"CENTER_NAME": "MARS"},
    "ECCENTRICITY 'x' is no number": {"ECCENTRICITY": "x"},
    "MEAN_ANOMALY 'NaN' is no number": {"MEAN_ANOMALY": "NaN"},
    "BSTAR '1e999' is no number": {"BSTAR": "1e999"},
    "no orbit about the Earth": {"ECCENTRICITY": "1.2"},
    "INCLINATION is missing": {"INCLINATION": ""},
    "EPOCH '2025-13-26T05:19:34'": {"EPOCH": "2025-13-26T05:19:34"},
    "SGP4 fails at its epoch": {"MEAN_MOTION": "19.9"},
}


# a CSV has columns for what its first line names
CASES = [(form, why) for why, change in BAD.items() for form in FORMS if form != "csv" or set(change) <= set(GOOD)]


@pytest.mark.parametrize(("form", "why"), CASES)
def test_one_bad_message_never_costs_the_others(form: str, why: str) -> None:
    bad = {**GOOD, "OBJECT_NAME": "WRONG", **BAD[why]}
    for order in ([GOOD, bad], [bad, GOOD], [bad, GOOD, bad]):
        told: list[str] = []
        found = read_elements(FORMS[form](*order), "file", told)
        assert [s.name for s in found] == ["HELIOS"]
        assert len(told) == order.count(bad)
        assert all(why in t and "WRONG" in t and t.startswith("file, ") for t in told)
    told = []
    with pytest.raises(UserError) as error:
        read_elements(FORMS[form](bad, bad), "file", told)
    assert str(error.value).count(why) == 2 == len(told)


def test_damaged_text_costs_its_own_message_only() -> None:
    two = {**GOOD, "OBJECT_NAME": "TWO"}
    whole = as_json(GOOD, two, GOOD)
    damaged = whole.replace('"TWO", "OBJECT_ID": "2004-049A"', '"TWO", "OBJECT_ID": "2004-049A')
    cases = {
        "damaged JSON": [damaged, whole[:-30].replace("TWO", "A").replace('"A"', '"TWO"')],
        "damaged XML": [as_xml(GOOD, two, GOOD).replace(">TWO</OBJECT_NAME>", ">TWO</OBJECT>")],
        "columns": [as_csv(GOOD, {**two, "BSTAR": "0,1"}, GOOD)],
        "is not KEY = VALUE": [as_kvn(GOOD, {**two, "OBJECT_ID": "a\nhello"}, GOOD)],
        "comes twice": [as_kvn(GOOD, {**two, "OBJECT_ID": "a\nEPOCH = 2025-085T00:00:00"}, GOOD)],
    }
    for why, texts in cases.items():
        for text in texts:
            told: list[str] = []
            found = read_elements(text, "file", told)
            assert [s.name for s in found if s.name == "HELIOS"], why
            assert len(found) == 2, why
            assert len(told) == 1, told
            assert why in told[0]


def test_entities_are_refused() -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "b"><!ENTITY c "&a;&a;&a;">]>'
    for text in (
        as_xml(GOOD).replace("<ndm>", bomb + "<ndm>"),
        as_xml({**GOOD, "OBJECT_NAME": "&other;"}),
        '<!DOCTYPE x SYSTEM "file:///etc/passwd">' + as_xml(GOOD),
    ):
        with pytest.raises(UserError, match="entit"):
            read_elements(text, "x")


def test_units_that_are_others_are_refused() -> None:
    text = as_kvn(GOOD).replace("[deg]", "[rad]")
    with pytest.raises(UserError, match=r"INCLINATION in rad: deg is needed"):
        read_elements(text, "x")


def test_other_messages_and_texts() -> None:
    for text, why in (
        ("CCSDS_OEM_VERS = 2.0\nOBJECT_NAME = X\n", "no orbit mean-elements message"),
        ("<oem/>", "no <omm>"),
        ("[]", "no two-line elements"),
        ("[" * 10_000 + '{"', "damaged JSON"),
        ('{"a": ' * 5_000, "nested too deeply"),
        ("", "no two-line elements"),
        ("\x00\x01", "no two-line elements"),
    ):
        with pytest.raises(UserError, match=why):
            read_elements(text, "x")


def summed(line: str) -> str:
    return line[:68] + str(sum(int(c) if c.isdigit() else (c == "-") for c in line[:68]) % 10)


def test_two_line_elements_one_by_one() -> None:
    one, two = lines_of(7, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
    alpha = tuple(summed(line[:2] + "A0007" + line[7:]) for line in (one, two))
    (s,) = read_elements("\n".join(alpha), "x")
    assert (s.name, s.number) == ("A0007", "A0007")
    xp = summed(one[:62] + "4" + one[63:])
    bad = {
        "elements of SGP4-XP": (xp, two),
        "a line 1 without its line 2": (one,),
        "a line 2 without its line 1": (two,),
        "characters long": (one[:60], two),
        "checksum": (one, two[:30] + ("9" if two[30] != "9" else "8") + two[31:]),
        "two satellites, 00007 and 00008": (one, summed(two[:2] + "00008" + two[7:])),
        "not in the columns": (summed(one[:20] + "x" + one[21:]), two),
        "SGP4 fails at its epoch": (one, summed(two[:26] + "9999999" + two[33:])),
    }
    for why, lines in bad.items():
        told: list[str] = []
        text = "\n".join(["0 FIRST", one, two, "WRONG", *lines, "LAST", one, two])
        assert [s.name for s in read_elements(text, "f", told)] == ["FIRST", "LAST"], why
        assert len(told) == 1
        assert why in told[0]
        assert "WRONG" in told[0]
        with pytest.raises(UserError, match=why):
            read_elements("\n".join(["WRONG", *lines]), "f", [])


def test_names_are_shown_as_text() -> None:
    one, two = lines_of(7, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
    (s,) = read_elements(f"\x1b[31mRED\x07\n{one}\n{two}\n", "x")
    assert s.name == "\\x1b[31mRED\\x07"


def test_no_text_however_wrong_is_a_traceback() -> None:
    """Texts of every form with characters and pieces changed, doubled or lost: satellites, or one UserError."""
    rng = np.random.default_rng(5)
    two = "\n".join(["NAME", *lines_of(7, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)] * 2)
    texts = [two, *(form(GOOD, {**GOOD, "OBJECT_NAME": "B"}) for form in FORMS.values())]
    pieces = [
        "\x00",
        "\n",
        '"',
        "{",
        "}",
        "<",
        "</omm>",
        "<omm>",
        "&a;",
        "nan",
        "1e999",
        "-",
        "9" * 400,
        "\ud7ff",
        ",",
        "=",
    ]
    for k in range(1500):
        text = texts[k % len(texts)]
        for _ in range(int(rng.integers(1, 6))):
            i, j = sorted(rng.integers(0, len(text) + 1, 2).tolist())
            j = min(j, i + int(rng.integers(1, 40)))
            kind = rng.integers(4)
            text = (
                text[:i] + text[j:] if kind == 0
                else text[:i] + text[i:j] * 2 + text[j:] if kind == 1
                else text[:i] + pieces[int(rng.integers(len(pieces)))] + text[(i if kind == 2 else j) :]
            )  # fmt: skip
        told: list[str] = []
        try:
            for one in read_elements(text, "x", told):
                assert np.isfinite(ecef_at(one, one.epoch)).all()
        except UserError as error:
            told.append(str(error))
        assert all(t.isprintable() for t in told)
