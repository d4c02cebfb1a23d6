#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Packs the C++ client library of a build for programs elsewhere, with the licenses of what it links:
#
#   deploy/build_client_library.sh [OUT_FOLDER]     build/packages; prints the name of the archive
#
# The archive unpacks into one folder, which find_package(tissueform) takes as CMAKE_PREFIX_PATH. It does not hold the libraries
# that it links: they are Debian's, and README.txt names their packages.
#
# TISSUEFORM_BUILD_DIR  what was built (default: build/release)
set -euo pipefail
cd "$(dirname "$0")/.."

build=$(realpath "${TISSUEFORM_BUILD_DIR:-build/release}")
out=${1:-build/packages}
mkdir -p "$out"
out=$(realpath "$out")
version=$(sed -n 's/^project(tissueform VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
name=tissueform-client-cpp_${version}_$(dpkg --print-architecture)
# The same sources make the same archive.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
umask 022

# What find_package(tissueform) looks for, and a compiler.
packages=(build-essential cmake pkg-config libabsl-dev libeigen3-dev libgrpc++-dev libprotobuf-dev libssl-dev libzstd-dev
  libsuitesparse-dev libopenblas-dev protobuf-compiler-grpc)

tree=$scratch/$name
documents=$tree/share/doc/tissueform
cmake --install "$build" --component client_cpp --prefix "$tree" >/dev/null
mkdir -p "$documents/licenses" "$tree/share/tissueform/proto/tissueform"
cp -r docs/examples/drag "$documents/example"
cp -r proto/tissueform/v1 "$tree/share/tissueform/proto/tissueform/"
cp LICENSE "$documents/"

# A program that links the library and nothing else says what that brings with it.
mkdir "$scratch/linked"
cp "$build/bin/client-cpp-alone" "$scratch/linked/"
bill=$documents/tissueform-client-cpp.spdx.json
deploy/write_sbom.py tissueform-client-cpp "$scratch/linked" "$bill"
linked=$(python3 - "$bill" <<'PYTHON'
import json, sys
bill = json.load(open(sys.argv[1], encoding="utf-8"))
ids = {each["relatedSpdxElement"] for each in bill["relationships"] if each["relationshipType"] == "DYNAMIC_LINK"}
print(*(each["name"] for each in bill["packages"] if each["SPDXID"] in ids))
PYTHON
)
# Eigen is headers, of which the library and its own headers are made.
for package in $linked libeigen3-dev; do
  cp "/usr/share/doc/$package/copyright" "$documents/licenses/$package"
done

cat >"$tree/README.txt" <<README
Tissueform $version, client library for C++20. Research software, not a medical device: not for diagnosis or treatment.

On Debian 12, with PREFIX for this folder:

  apt-get install --no-install-recommends ${packages[*]}
  cp -r PREFIX/share/doc/tissueform/example drag && cd drag
  TISSUEFORM_PREFIX=PREFIX cmake --preset release && cmake --build --preset release
  build/drag 127.0.0.1:50051     # with a tissueform-server there

Your CMakeLists.txt: find_package(tissueform ${version%.*} REQUIRED), then link tissueform::client_cpp.
Headers say what each call does: include/tissueform/client/cpp/tissueform_client.h.
Licenses: share/doc/tissueform. The library is AGPL-3.0-or-later; so is, as a whole, a program that links it.
README

tar --directory "$scratch" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner --create "$name" | gzip -9n >"$out/$name.tar.gz"
echo "$out/$name.tar.gz"
