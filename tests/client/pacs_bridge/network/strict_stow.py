#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A STOW-RS server that takes one spelling of the multipart boundary only, as some servers do.

    strict_stow.py PORT quoted|bare|neither

Stores nothing: it checks that the body is one DICOM object between these boundaries, and answers with its UID.
"""

import http.server
import json
import re
import sys

BOUNDARY = {"quoted": r'"([^"]+)"', "bare": r'([^"]+)', "neither": r"(?!)"}[sys.argv[2]]
CONTENT_TYPE = re.compile(r'multipart/related; type="application/dicom"; boundary=' + BOUNDARY)
PART_HEADER = b"Content-Type: application/dicom\r\n\r\n"
SOP_INSTANCE_UID = b"\x08\x00\x18\x00UI"


class StrictStow(http.server.BaseHTTPRequestHandler):

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        named = CONTENT_TYPE.fullmatch(self.headers["Content-Type"])
        if named is None:
            return self.answer(400, {})
        boundary = named[1].encode()
        before, _, rest = body.partition(b"--" + boundary + b"\r\n" + PART_HEADER)
        part, _, after = rest.partition(b"\r\n--" + boundary + b"--\r\n")
        if before or after or part[128:132] != b"DICM":
            return self.answer(415, {})
        start = part.index(SOP_INSTANCE_UID) + len(SOP_INSTANCE_UID)
        length = int.from_bytes(part[start:start + 2], "little")
        uid = part[start + 2:start + 2 + length].decode().rstrip("\0")
        return self.answer(200, {"00081199": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": [uid]}}]}})

    def answer(self, status, content):
        text = json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/dicom+json")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)


http.server.HTTPServer(("127.0.0.1", int(sys.argv[1])), StrictStow).serve_forever()
