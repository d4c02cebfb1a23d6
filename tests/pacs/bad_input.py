# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Series that must not become a plan, sent to a bridge that runs: it says why, and goes on. `check(what, good, more)` keeps account."""

import shutil
import subprocess

import head_series
import stack


def put_twice(image, index):
    if index == head_series.SHAPE[0] - 1:  # where the one before lies
        image.ImagePositionPatient = [*image.ImagePositionPatient[:2], f"{-head_series.SLICE_MM * (index - 1):.1f}"]


def give_another_patient(image, index):
    if index > 40:
        image.PatientID = "OTHER-0815"


def make_magnetic(image, _):
    image.Modality = "MR"


def forget_hounsfield(image, _):
    del image.RescaleIntercept, image.RescaleSlope, image.RescaleType


# How a series is spoilt, and what is said of it.
SPOILT = {
    "slices twice at one place": (put_twice, "passed_over", "1 images have the position of another one"),
    "two patients in one series": (give_another_patient, "failed", "its images name different patients"),
    "an MR": (make_magnetic, "passed_over", "its modality is MR, which has no Hounsfield units"),
    "a cone-beam CT without Hounsfield units": (forget_hounsfield, "passed_over", "it has no Hounsfield calibration"),
}


def series_by_key(programs):
    return {series["key"]: series for series in programs.bridge_status().get("series", [])}


def check_bad_series(check, programs, **patient):
    """All in one association, from one who may send."""
    folder = programs.folder / "spoilt"
    shutil.rmtree(folder, ignore_errors=True)
    for number, (spoil, _, _) in enumerate(SPOILT.values()):
        head_series.write_series(folder / str(number), number=number, alter=spoil, **patient)
    known = series_by_key(programs).keys()
    certificate, key = programs.identities["scanner"]
    command = ["storescu", "--aetitle", stack.ORTHANC, "--call", stack.BRIDGE, "--enable-tls", key, certificate, "--add-cert-file",
               programs.authority.certificate, "--scan-directories", "--recurse", stack.HOST, programs.bridge_dicom, folder]
    sent = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False, env=stack.QUICK)
    check("the bridge takes bad series", sent.returncode == 0, sent.stderr[-300:])

    def judged():
        new = [series for name, series in series_by_key(programs).items() if name not in known]
        return len(new) == len(SPOILT) and all(series["state"] in ("passed_over", "failed") for series in new) and new
    found = programs.wait_for("what is said of bad series", judged, needs="bridge")
    for what, (_, state, words) in SPOILT.items():
        check(f"of {what} it says why nothing is made of it", any(series["state"] == state and words in series["reason"] for series in found),
              "; ".join(series["reason"] for series in found))
