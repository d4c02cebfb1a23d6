#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes label maps of a phantom with pydicom, DCMTK, nibabel, VTK and Teem's unu: label_reader_test.cc reads them.

Usage: write_labels.py DIR.
"""

import os
import subprocess
import sys

import nibabel
import numpy as np
import pydicom
import vtk
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import DeflatedExplicitVRLittleEndian, ExplicitVRLittleEndian, RLELossless
from vtk.util.numpy_support import numpy_to_vtk

# The phantom, as label_reader_test.cc has it: i, j, k, with the last index excluded.
SIZE = (20, 24, 16)
SPACING = (1.5, 1.0, 2.0)
ORIGIN = (-12.0, 30.0, 900.0)
SKULL = ((3, 16), (4, 21), (8, 15))
MANDIBLE = ((3, 10), (4, 13), (2, 7))
CANAL = ((5, 8), (6, 10), (3, 6))  # inside the mandible
FRAME_UID = "1.2.826.0.1.3680043.8.498.1"


def box(limits):
    mask = np.zeros(SIZE, bool)
    mask[tuple(slice(*limit) for limit in limits)] = True
    return mask


def numbers():
    """DentalSegmentator's: the canal hides the mandible."""
    values = np.zeros(SIZE, np.uint8)
    values[box(SKULL)] = 1
    values[box(MANDIBLE)] = 2
    values[box(CANAL)] = 5
    return values


def turned():
    """Directions, as columns, of a head that is turned by 10 degrees."""
    angle = np.radians(10)
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def write_nifti(path, values, table=None, affine=None):
    lps = np.eye(4)
    lps[:3, :3] = turned() @ np.diag(SPACING)
    lps[:3, 3] = ORIGIN
    image = nibabel.Nifti1Image(values, np.diag([-1, -1, 1, 1]) @ lps if affine is None else affine)
    image.set_sform(image.affine, 1)
    image.set_qform(image.affine, 1)
    image.header.set_xyzt_units("mm")
    if table:
        # As TotalSegmentator writes it.
        rows = "".join(f'<Label Key="{key}" Red="0.5" Green="0.5" Blue="0.5" Alpha="1"><![CDATA[{name}]]></Label>' for key, name in table)
        xml = f'<?xml version="1.0" encoding="UTF-8"?><CaretExtension><LabelTable>{rows}</LabelTable></CaretExtension>'
        image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, xml.encode()))
    nibabel.save(image, path)


def write_vtk(writer, path):
    image = vtk.vtkImageData()
    image.SetDimensions(*SIZE)
    image.SetSpacing(*SPACING)
    image.SetOrigin(*ORIGIN)
    image.GetPointData().SetScalars(numpy_to_vtk(numbers().ravel(order="F"), deep=True))
    writer.SetInputData(image)
    writer.SetFileName(path)
    writer.Write()


TAGS = "TerminologyEntry:Segmentation category and type~SCT^123037004^Anatomical Structure~SCT^{}~^^~Anatomic codes~^^~^^|"


def write_nrrd(path, layers, segments):
    """With unu; `segments` are the key and value pairs of Slicer."""
    raw = path + ".raw"
    data = layers[0] if len(layers) == 1 else np.stack(layers)
    with open(raw, "wb") as stream:
        stream.write(np.asfortranarray(data).tobytes(order="F"))
    steps = turned() @ np.diag(SPACING)
    directions = ["(%r,%r,%r)" % tuple(float(x) for x in column) for column in steps.T]
    listed = len(layers) > 1
    command = ["teem-unu", "make", "-i", raw, "-t", "uchar", "-s", *[str(n) for n in data.shape], "-spc", "LPS",
               "-orig", "(%r,%r,%r)" % ORIGIN, "-dirs", " ".join((["none"] if listed else []) + directions),
               "-k", *((["list"] if listed else []) + ["domain"] * 3), "-kv",
               # unu takes a first pair with a space for several.
               "Segmentation_MasterRepresentation:=Binary", *[f"{key}:={value}" for key, value in segments.items()], "-e", "gzip", "-o", path]
    subprocess.run(command, check=True)
    os.remove(raw)


def code(value, meaning):
    item = Dataset()
    item.CodeValue, item.CodingSchemeDesignator, item.CodeMeaning = value, "SCT", meaning
    return item


def write_seg(path, kind, segments, frame_uid=FRAME_UID, sop_class="1.2.840.10008.5.1.4.1.1.66.4", modality="SEG", syntax=ExplicitVRLittleEndian):
    """`segments`: (label, code, mask) each; `kind`: BINARY, FRACTIONAL or LABELMAP. Only slices that hold something."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop_class
    meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data = FileDataset(path, {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = sop_class, meta.MediaStorageSOPInstanceUID
    data.PatientName, data.PatientID = "Nobody^Known", "secret-17"
    data.Modality, data.FrameOfReferenceUID, data.SegmentationType = modality, frame_uid, kind
    data.SamplesPerPixel, data.PhotometricInterpretation, data.PixelRepresentation = 1, "MONOCHROME2", 0
    data.Columns, data.Rows = SIZE[0], SIZE[1]
    bits = 1 if kind == "BINARY" else 8
    data.BitsAllocated, data.BitsStored, data.HighBit = bits, bits, bits - 1
    if kind == "FRACTIONAL":
        data.SegmentationFractionalType, data.MaximumFractionalValue = "PROBABILITY", 200
    data.SegmentSequence = Sequence()
    for number, (label, meaning, _) in enumerate(segments, 1):
        item = Dataset()
        item.SegmentNumber, item.SegmentLabel, item.SegmentAlgorithmType = number, label, "AUTOMATIC"
        item.SegmentedPropertyTypeCodeSequence = Sequence([meaning])
        data.SegmentSequence.append(item)
    shared = Dataset()
    orientation, measures = Dataset(), Dataset()
    steps = turned()
    orientation.ImageOrientationPatient = [*steps[:, 0], *steps[:, 1]]
    measures.PixelSpacing, measures.SliceThickness = [SPACING[1], SPACING[0]], SPACING[2]
    measures.SpacingBetweenSlices = SPACING[2]
    shared.PlaneOrientationSequence, shared.PixelMeasuresSequence = Sequence([orientation]), Sequence([measures])
    data.SharedFunctionalGroupsSequence = Sequence([shared])
    data.PerFrameFunctionalGroupsSequence = Sequence()
    frames = []

    def add_frame(k, number, pixels):
        group, place = Dataset(), Dataset()
        place.ImagePositionPatient = [float(x) for x in np.array(ORIGIN) + k * SPACING[2] * steps[:, 2]]
        group.PlanePositionSequence = Sequence([place])
        if number:
            identification = Dataset()
            identification.ReferencedSegmentNumber = number
            group.SegmentIdentificationSequence = Sequence([identification])
        data.PerFrameFunctionalGroupsSequence.append(group)
        frames.append(pixels.T.ravel())  # row after row

    if kind == "LABELMAP":
        values = np.zeros(SIZE, np.uint8)
        for number, (_, _, mask) in enumerate(segments, 1):
            values[mask] = number
        for k in range(SIZE[2]):
            add_frame(k, 0, values[:, :, k])
    else:
        for number, (_, _, mask) in enumerate(segments, 1):
            # From the top, as some writers store them.
            for k in reversed(range(SIZE[2])):
                if mask[:, :, k].any():
                    add_frame(k, number, mask[:, :, k].astype(np.uint8) * (120 if kind == "FRACTIONAL" else 1)
                              + (70 if kind == "FRACTIONAL" else 0) * (~mask[:, :, k]))
    data.NumberOfFrames = len(frames)
    pixels = np.concatenate(frames).astype(np.uint8)
    stored = np.packbits(pixels, bitorder="little").tobytes() if bits == 1 else pixels.tobytes()
    data.PixelData = stored + b"\0" * (len(stored) % 2)
    data["PixelData"].VR = "OB"
    data.is_little_endian, data.is_implicit_VR = True, False
    if syntax == RLELossless:
        data.compress(RLELossless, encoding_plugin="pydicom")
    meta.TransferSyntaxUID = syntax  # pydicom deflates while it writes
    data.save_as(path, write_like_original=False)


def write_masks(folder, masks, dtype=np.uint8):
    """A folder as TotalSegmentator writes it; `masks`: name and values of each."""
    os.makedirs(folder, exist_ok=True)
    for name, values in masks.items():
        write_nifti(os.path.join(folder, name + ".nii.gz"), values.astype(dtype))
    with open(os.path.join(folder, "statistics.json"), "w", encoding="utf-8") as stream:
        stream.write("{}")


def write_mask_folders(path):
    empty = np.zeros(SIZE, bool)
    masks = {"skull": box(SKULL), "mandible": box(MANDIBLE), "inferior_alveolar_canal": box(CANAL)}
    write_masks(path("masks"), {**masks, "sinus_frontal": empty, "aorta": box(SKULL), "vertebrae_T1": box(CANAL)})
    write_masks(path("masks_255"), {name: mask * 255 for name, mask in masks.items()}, np.int16)
    write_masks(path("renamed"), {"Smith_1": box(SKULL), "mandible": box(MANDIBLE), "inferior_alveolar_canal": box(CANAL)})
    write_masks(path("all_unknown"), {f"organ_{n}": box(SKULL) for n in range(9)})
    write_masks(path("all_empty"), {"skull": empty, "mandible": empty})
    write_masks(path("several_labels"), {"skull": numbers()})
    write_masks(path("fractions"), {"skull": box(SKULL) * 0.3}, np.float32)
    write_masks(path("other_grid"), masks)
    shifted = np.diag([-1.5, -1.0, 2.0, 1.0])
    write_nifti(os.path.join(path("other_grid"), "skull.nii.gz"), box(SKULL).astype(np.uint8), affine=shifted)
    write_masks(path("other_size"), {**masks, "skull": np.pad(box(SKULL), 1)})
    write_masks(path("swapped_masks"), {"mandibular_canal_left": box(((3, 5), (6, 10), (3, 6))),
                                        "mandibular_canal_right": box(((8, 10), (6, 10), (3, 6)))})
    write_masks(path("twice"), masks)
    write_nifti(os.path.join(path("twice"), "skull.nii"), box(SKULL).astype(np.uint8))
    write_masks(path("no_masks"), {})


def main(folder):
    def path(name):
        return os.path.join(folder, name)

    write_nifti(path("numbers.nii.gz"), numbers())
    write_nifti(path("float.nii"), numbers().astype(np.float32))
    write_nifti(path("probability.nii"), numbers().astype(np.float32) * 0.37)
    write_nifti(path("negative.nii"), numbers().astype(np.int16) - 1024)
    write_nifti(path("empty.nii"), numbers() * 0)
    shuffled = numbers()
    shuffled = np.choose(shuffled, [0, 71, 40, 0, 0, 9, 0, 0, 0]).astype(np.uint8)
    write_nifti(path("named.nii.gz"), shuffled, [(71, "skull"), (40, "mandible"), (9, "inferior_alveolar_canal_left")])
    write_nifti(path("unknown.nii"), shuffled, [(71, "Smith tumor\n"), (40, "b"), (9, "c")])
    writer = vtk.vtkMetaImageWriter()
    write_vtk(writer, path("vtk.mha"))
    writer = vtk.vtkNIFTIImageWriter()
    matrix = vtk.vtkMatrix4x4()
    writer.SetSFormMatrix(matrix)
    write_vtk(writer, path("vtk.nii"))

    layers = [np.where(box(SKULL), 1, np.where(box(MANDIBLE), 2, 0)).astype(np.uint8), box(CANAL).astype(np.uint8)]
    write_nrrd(path("layers.seg.nrrd"), layers, {
        "Segment0_ID": "Segment_1", "Segment0_Name": "Upper", "Segment0_LabelValue": "1", "Segment0_Layer": "0",
        "Segment0_Tags": TAGS.format("89546000^Skull"),
        "Segment1_ID": "Segment_2", "Segment1_Name": "Mandible", "Segment1_LabelValue": "2", "Segment1_Layer": "0",
        "Segment2_ID": "Segment_3", "Segment2_Name": "Mandibular canal", "Segment2_LabelValue": "1", "Segment2_Layer": "1"})
    write_nrrd(path("one_layer.seg.nrrd"), [numbers()], {
        "Segment0_Name": "Upper skull", "Segment0_LabelValue": "1", "Segment0_Layer": "0",
        "Segment1_Name": "Mandible", "Segment1_LabelValue": "2", "Segment1_Layer": "0",
        "Segment2_Name": "Mandibular canal", "Segment2_LabelValue": "5", "Segment2_Layer": "0"})
    # The canal of the right, which lies left of that of the left.
    right = box(((8, 10), (6, 10), (3, 6)))
    swapped = np.where(right, 2, np.where(box(((3, 5), (6, 10), (3, 6))), 1, 0)).astype(np.uint8)
    write_nrrd(path("swapped.seg.nrrd"), [swapped], {
        "Segment0_Name": "Left mandibular canal", "Segment0_LabelValue": "1", "Segment0_Layer": "0",
        "Segment1_Name": "Right mandibular canal", "Segment1_LabelValue": "2", "Segment1_Layer": "0"})

    parts = [("Upper", code("89546000", "Skull"), box(SKULL)), ("jaw", code("91609006", "Mandible"), box(MANDIBLE)),
             ("Mandibular canal", code("1", "?"), box(CANAL))]
    write_seg(path("binary.dcm"), "BINARY", parts)
    write_seg(path("fractional.dcm"), "FRACTIONAL", parts)
    write_seg(path("labelmap.dcm"), "LABELMAP", parts, sop_class="1.2.840.10008.5.1.4.1.1.66.7")
    for kind, sop_class in (("BINARY", "1.2.840.10008.5.1.4.1.1.66.4"), ("FRACTIONAL", "1.2.840.10008.5.1.4.1.1.66.4"),
                            ("LABELMAP", "1.2.840.10008.5.1.4.1.1.66.7")):
        write_seg(path(f"{kind.lower()}_deflated.dcm"), kind, parts, sop_class=sop_class, syntax=DeflatedExplicitVRLittleEndian)
        if kind != "BINARY":
            write_seg(path(f"{kind.lower()}_rle.dcm"), kind, parts, sop_class=sop_class, syntax=RLELossless)
    many = [(f"part {n}", code("1", "?"), box(((n % 20, n % 20 + 1), (3, 9), (3, 5)))) for n in range(197)]
    write_seg(path("many.dcm"), "BINARY", parts + many)
    # DCMTK's deflated files have an even length, as those of dcmqi.
    subprocess.run(["dcmconv", "+td", path("binary.dcm"), path("binary_dcmtk.dcm")], check=True)
    write_mask_folders(path)
    write_seg(path("ct.dcm"), "BINARY", parts, sop_class="1.2.840.10008.5.1.4.1.1.2", modality="CT")


if __name__ == "__main__":
    main(sys.argv[1])
