#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Fails when a program is linked with a library that reads files of meshes or images, or with one that speaks HTTP. Run on the server: what clients
# send is parsed by our own few lines and protobuf only, and its image stays small. And on a program of client/cpp alone:
# those who build on it need none of these libraries.
#
#   tests/scripts/check_file_library_links.sh PROGRAM
set -euo pipefail

program=${1:?usage: check_file_library_links.sh PROGRAM}
libraries=$(ldd "$program")
if grep -iE 'libvtk|libITK|libdcm|libgdcm|libgmsh|libtet|libCGAL|libhdf5|libexpat|libzip' <<<"$libraries"; then
  echo "check_file_library_links.sh: $program is linked with a file library (see above)" >&2
  exit 1
fi
# CGAL is compiled in, TetGen may be.
symbols=$(nm --demangle "$program" 2>/dev/null || true)
if grep -m 3 -E 'CGAL::|tetgenmesh::' <<<"$symbols"; then
  echo "check_file_library_links.sh: $program holds code of a file library (see above)" >&2
  exit 1
fi
# What browsers send is the gateway's.
if grep -m 3 -E 'boost::(beast|asio)::' <<<"$symbols"; then
  echo "check_file_library_links.sh: $program holds code of Boost.Beast (see above)" >&2
  exit 1
fi
