#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Fails when the server is linked with a library that reads files of meshes or images: what clients send is
# parsed by our own few lines and protobuf only, and the image of the server stays small.
#
#   tests/scripts/check_server_links.sh PATH_OF_TISSUEFORM_SERVER
set -euo pipefail

server=${1:?usage: check_server_links.sh PATH_OF_TISSUEFORM_SERVER}
libraries=$(ldd "$server")
if grep -iE 'libvtk|libITK|libdcm|libgmsh|libhdf5|libexpat' <<<"$libraries"; then
  echo "check_server_links.sh: the server is linked with a file library (see above)" >&2
  exit 1
fi
