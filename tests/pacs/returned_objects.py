# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What the bridge has put into a study, looked at by programs that nobody here wrote: Orthanc, pydicom, dciodvfy, dcmj2pnm and
GDCM. `check(what, good, more)` keeps account."""

import io
import pathlib
import shutil
import subprocess

import numpy
import pydicom

import stack

STL = "1.2.840.10008.5.1.4.1.1.104.3"
# As dciodvfy calls them.
IOD_NAMES = {"M3D": "EncapsulatedSTL", "OT": "MultiframeTrueColorSCImage", "SR": "ComprehensiveSR"}


def objects_of(programs, study):
    """What is no CT image, by Orthanc's name: bytes, tags as Orthanc knows them, and as pydicom reads them."""
    found = {}
    for instance in programs.instances_of(study):
        tags = programs.orthanc(f"/instances/{instance}/simplified-tags")
        if tags["Modality"] == "CT":
            continue
        data = programs.orthanc_file(instance)
        found[instance] = (data, tags, pydicom.dcmread(io.BytesIO(data)))
    return found


def what_dciodvfy_misses(path, modality):
    """Its errors; or that it has not taken the object for what it is, without which there are no errors either."""
    run = subprocess.run(["dciodvfy", path], capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False)
    lines = (run.stdout + run.stderr).splitlines()
    missed = [line for line in lines if line.startswith("Error")]
    if IOD_NAMES[modality] not in lines:
        missed.append(f"it does not say {IOD_NAMES[modality]}")
    if run.returncode != 0:
        missed.append(f"its exit code is {run.returncode}")
    return missed


def terms(item):
    """What the report names, with its numbers."""
    for child in item.get("ContentSequence", []):
        name = child.get("ConceptNameCodeSequence")
        number = child.get("MeasuredValueSequence")
        yield (name[0].CodeValue if name else "", number[0] if number else None)
        yield from terms(child)


def units_by_pydicom(item):
    """Code, scheme and number of every unit of an object, in their order."""
    found = []
    for element in item:
        if element.VR != "SQ":
            continue
        if element.keyword == "MeasurementUnitsCodeSequence":
            found += [(unit.CodeValue, unit.CodingSchemeDesignator, str(item.get("NumericValue", ""))) for unit in element]
        else:
            for child in element:
                found += units_by_pydicom(child)
    return found


def units_by_orthanc(tags):
    """The same of Orthanc's simplified tags, which are not in the order of the file."""
    number = tags.get("NumericValue", "")
    found = [(unit["CodeValue"], unit["CodingSchemeDesignator"], number) for unit in tags.get("MeasurementUnitsCodeSequence", [])]
    for name, value in tags.items():
        if isinstance(value, list) and name != "MeasurementUnitsCodeSequence":
            for child in value:
                found += units_by_orthanc(child)
    return found


def check_report(check, report):
    found = list(terms(report))
    names = {name for name, _ in found}
    check("the report tells poses, movements of places and their band", {"MOVEMENT", "BAND"} <= names, str(sorted(names)))
    bands = [float(number.NumericValue) for name, number in found if name == "BAND"]
    check("a band is some of a movement and none is zero", bands and all(0 < band < 20 for band in bands), str(bands))
    check("its numbers are mm, degrees or counts by UCUM",
          all(number.MeasurementUnitsCodeSequence[0].CodingSchemeDesignator == "UCUM" for _, number in found if number is not None))


def check_models(check, objects, original, written):
    models = [item for _, _, item in objects.values() if item.SOPClassUID == STL]
    check("there are models of skin and bone", len(models) >= 3, str(len(models)))
    check("units are mm", all(model.MeasurementUnitsCodeSequence[0].CodeValue == "mm" for model in models))
    check("models lie in the CT's frame of reference", all(model.FrameOfReferenceUID == original.FrameOfReferenceUID for model in models))
    back = {model.SOPInstanceUID: bytes(model.EncapsulatedDocument) for model in models}
    check("STL comes back byte for byte", len(back) > 0 and written == back, f"{len(written)} written, {len(back)} back")
    for model in models:
        length = model.EncapsulatedDocumentLength
        stl = bytes(model.EncapsulatedDocument)[:length]
        count = int.from_bytes(stl[80:84], "little")
        check(f"{model.DocumentTitle} is a binary STL", len(stl) == 84 + 50 * count and count > 100, f"{len(stl)} bytes, {count} triangles")


def frames_by_dcmtk(folder, path):
    """Pixels of all frames: frame, row, column, colour."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    subprocess.run(["dcmj2pnm", "--write-raw-pnm", "--all-frames", path, folder / "frame"], capture_output=True, timeout=stack.PATIENCE_S, check=False)
    frames = []
    for number in range(len(list(folder.iterdir()))):
        kind, size, most, pixels = next(folder.glob(f"frame.{number}.*")).read_bytes().split(b"\n", 3)
        columns, rows = map(int, size.split())
        if (kind, most) != (b"P6", b"255"):
            return None
        frames.append(numpy.frombuffer(pixels, numpy.uint8).reshape(rows, columns, 3))
    return numpy.stack(frames) if frames else None


def frames_by_gdcm(folder, path):
    """The same by GDCM, which writes a file that is not compressed."""
    plain = folder / "gdcm.dcm"
    run = subprocess.run(["gdcmconv", "--raw", path, plain], capture_output=True, timeout=stack.PATIENCE_S, check=False)
    if run.returncode != 0:
        return None
    item = pydicom.dcmread(plain)
    pixels = numpy.frombuffer(item.PixelData, numpy.uint8)
    shape = (int(item.NumberOfFrames), item.Rows, item.Columns, item.SamplesPerPixel)
    return pixels.reshape(shape) if item.PlanarConfiguration == 0 and pixels.size == numpy.prod(shape) else None


def check_capture(check, folder, path, frames):
    by_dcmtk = frames_by_dcmtk(folder / "frames", path)
    check("dcmj2pnm reads all frames of the capture", by_dcmtk is not None and len(by_dcmtk) == frames, f"not {frames}")
    if by_dcmtk is None:
        return
    different = len({frame.tobytes() for frame in by_dcmtk})
    check("no two frames are one picture, and none is of one colour", different == frames and all(frame.std() > 0 for frame in by_dcmtk))
    if shutil.which("gdcmconv") is None:
        print("     skipped: gdcmconv is not installed (libgdcm-tools): GDCM reads no frame", flush=True)
        return
    by_gdcm = frames_by_gdcm(folder, path)
    check("GDCM reads the same pixels in all frames of the capture", by_gdcm is not None and numpy.array_equal(by_gdcm, by_dcmtk))


def check_objects(check, programs, study, ct_folder, written):
    original = pydicom.dcmread(next(pathlib.Path(ct_folder).glob("*.dcm")))
    objects = objects_of(programs, study)
    folder = programs.folder / "back"
    folder.mkdir(exist_ok=True)
    for instance, (data, tags, item) in objects.items():
        path = folder / f"{instance}.dcm"
        path.write_bytes(data)
        missed = what_dciodvfy_misses(path, tags["Modality"])
        check(f"dciodvfy finds no error in the {tags['Modality']}", not missed, "; ".join(missed[:4]))
        same = all(tags.get(name, "") == str(item.get(name, "")) for name in ("SOPInstanceUID", "SeriesInstanceUID", "StudyInstanceUID", "SOPClassUID"))
        check(f"Orthanc and pydicom agree on the UIDs of the {tags['Modality']}", same)
        by_orthanc, by_pydicom = sorted(units_by_orthanc(tags)), sorted(units_by_pydicom(item))
        check(f"and on its {len(by_pydicom)} units", by_orthanc == by_pydicom and (len(by_pydicom) > 0) == (item.Modality != "OT"),
              f"{by_orthanc[:3]} {by_pydicom[:3]}")
        copied = ("PatientName", "PatientID", "PatientBirthDate", "StudyInstanceUID", "StudyID", "StudyDate", "AccessionNumber")
        check(f"patient and study of the {tags['Modality']} are the CT's", all(item.get(name) == original.get(name) for name in copied))
        if item.Modality == "OT":
            check_capture(check, programs.folder, path, int(item.NumberOfFrames))
        if item.Modality == "SR":
            check_report(check, item)
    kinds = {tags["Modality"] for _, tags, _ in objects.values()}
    check("there are models, a capture and a report", kinds == set(IOD_NAMES), str(kinds))
    check_models(check, objects, original, written)
