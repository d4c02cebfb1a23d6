#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Reads with pydicom what WritePredictionObjects has written, and holds it against docs/dicom-attributes.csv.

read_objects.py MANIFEST TABLE: MANIFEST is JSON, {"source": FILE, "uids": {KEY: UID}, "objects": {KEY: FILE},
"stl": FOLDER}. TABLE says what every attribute holds. Prints every difference
and ends with 1 when there is one; writes the models as FOLDER/KEY.stl.
"""

import csv
import json
import pathlib
import re
import sys

import pydicom

# A column of the table, by the beginning of an object's key.
COLUMNS = {"stl": 2, "capture": 3, "report": 4}


def table_rows(table):
    """The cells of the attribute table: name, tag, models, capture, report."""
    with table.open(encoding="utf-8", newline="") as lines:
        return list(csv.reader(lines))[1:]


def text_of(dataset, name):
    if name not in dataset:
        return None
    element = dataset[name]
    if element.VR == "SQ":
        return f"{len(element.value)} items" if element.value else ""
    if element.value is None:
        return ""
    if element.VM > 1:
        return "\\".join(str(value) for value in element.value)
    return str(element.value)


def difference(cell, dataset, name, key, manifest, source):
    """What is wrong with an attribute, or None."""
    value = text_of(dataset, name)
    if cell == "absent":
        return None if value is None else f"is there: {value}"
    if cell == "empty":
        return None if value == "" else f"is not empty: {value}"
    if cell == "source":
        expected = text_of(source, name)
        return None if (value or "") == (expected or "") else "is not that of the source"
    if value is None or value == "":
        return "is missing or empty"
    if cell == "any":
        return None
    if cell.startswith("UID of "):
        expected = manifest["uids"][key if cell == "UID of the object" else {
            "UID of the series": "series:" + ("models" if key.startswith("stl:") else key),
            "UID of the group": "group"}[cell]]
        return None if value == expected else f"is {value} instead of {expected}"
    choices = re.findall(r"`([^`]*)`", cell)
    if not choices:
        return f"cannot be checked: the table says {cell}"
    # "or": any of them; "with": what it holds.
    if " with " in f" {cell} ":
        return None if all(choice in value for choice in choices) else f"is {value}"
    return None if value in choices else f"is {value} instead of {' or '.join(choices)}"


def main():
    manifest = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    rows = table_rows(pathlib.Path(sys.argv[2]))
    problems = [] if len(rows) > 40 else [f"only {len(rows)} rows are found in the table"]
    source = pydicom.dcmread(manifest["source"], stop_before_pixels=True)
    for key, path in manifest["objects"].items():
        dataset = pydicom.dcmread(path)
        known = set()
        for name, tag, *_ in rows:
            row = next(cells for cells in rows if cells[0] == name)
            known.add(name)
            if f"({pydicom.tag.Tag(name).group:04X},{pydicom.tag.Tag(name).element:04X})" != tag:
                problems.append(f"{name} is not {tag}")
            wrong = difference(row[COLUMNS[key.split(":")[0]]], dataset, name, key, manifest, source)
            if wrong:
                problems.append(f"{key}: {name} {wrong}")
        for element in dataset:
            if element.keyword not in known and element.keyword not in source:
                problems.append(f"{key}: {element.keyword} is not in the table")
        if key.startswith("stl:"):
            stl = dataset.EncapsulatedDocument[: dataset.EncapsulatedDocumentLength]
            name = key.replace(":", "_") + ".stl"
            (pathlib.Path(manifest["stl"]) / name).write_bytes(stl)
            unit = dataset.MeasurementUnitsCodeSequence[0]
            if (unit.CodeValue, unit.CodingSchemeDesignator) != ("mm", "UCUM"):
                problems.append(f"{key}: the unit is {unit.CodeValue}")
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
