#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Makes Debian packages of what deploy/build.sh release and deploy/build_web.sh have built, and compiles nothing:
#
#   tissueform-server   the server, its unit, its user, /etc/tissueform/server.ini
#   tissueform-gateway  the gateway and the planner for browsers, likewise
#   tissueform-tools    the commands, with plans, schemas and manual pages
#   tissueform-pacs     the bridge to a PACS, its unit, its user, /etc/tissueform/pacs.ini; needs tissueform-tools
#
#   deploy/build_packages.sh [OUT_FOLDER [PACKAGE...]]     build/packages, and all of them
#
# Each package has its bill of materials in /usr/share/tissueform/sbom, and a copy beside the package.
#
# TISSUEFORM_BUILD_DIR  what was built (default: build/release)
set -euo pipefail
cd "$(dirname "$0")/.."

build=$(realpath "${TISSUEFORM_BUILD_DIR:-build/release}")
out=${1:-build/packages}
shift || true
packages=("${@:-tissueform-server}")
if [[ $# -eq 0 ]]; then packages=(tissueform-server tissueform-gateway tissueform-tools tissueform-pacs); fi
mkdir -p "$out"
out=$(realpath "$out")

version=$(sed -n 's/^project(tissueform VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
architecture=$(dpkg --print-architecture)
# The same sources make the same packages.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
umask 022

# Libraries as Debian's packages, of the programs in $1.
depends_on_libraries() {
  local work=$scratch/shlibs programs
  mkdir -p "$work/debian"
  printf 'Source: tissueform\nPackage: tissueform\nArchitecture: any\n' >"$work/debian/control"
  mapfile -t programs < <(find "$1/usr/bin" "$1/usr/libexec" -type f -exec sh -c 'head -c 4 "$1" | grep -q ELF' _ {} \; -print 2>/dev/null)
  (cd "$work" && dpkg-shlibdeps -O "${programs[@]/#/-e}" 2>"$work/warnings") | sed -n 's/^shlibs:Depends=//p'
}

# Copyright and changes, as Debian wants them.
add_documents() {
  local package=$1 folder=$2/usr/share/doc/$1
  mkdir -p "$folder"
  {
    printf 'Tissueform, Copyright 2026 The Tissueform Authors. Licence: AGPL-3.0-or-later, as follows.\n'
    printf 'Research software, not a medical device: not for diagnosis or treatment.\n\n'
    cat LICENSE
  } >"$folder/copyright"
  {
    printf 'tissueform (%s) unstable; urgency=medium\n\n' "$version"
    printf '  * As CHANGELOG.md says.\n\n'
    printf ' -- The Tissueform Authors <tissueform@localhost>  %s\n' "$(date -u -R -d "@$SOURCE_DATE_EPOCH")"
  } | gzip -9n >"$folder/changelog.gz"
  gzip -9nc CHANGELOG.md >"$folder/NEWS-of-tissueform.md.gz"
}

# What the package is made of. Not in /usr/share/doc, which images leave out.
add_bill() {
  local package=$1 tree=$2
  deploy/write_sbom.py "$package" "$tree" "$tree/usr/share/tissueform/sbom/$package.spdx.json"
  cp "$tree/usr/share/tissueform/sbom/$package.spdx.json" "$out/${package}_${version}_$architecture.spdx.json"
}

add_man_page() {
  if [[ -e $build/man/$1.1 ]]; then
    mkdir -p "$2/usr/share/man/man1"
    gzip -9nc "$build/man/$1.1" >"$2/usr/share/man/man1/$1.1.gz"
  fi
}

# A unit, its configuration, and scripts that make its user and, where $6 is yes, start it.
add_service() {
  local package=$1 tree=$2 user=$3 state=$4 config=$5 starts=$6 file
  install -Dm 644 "deploy/systemd/$package.service" "$tree/lib/systemd/system/$package.service"
  install -Dm 644 "deploy/config/$config" "$tree/etc/tissueform/$config"
  printf '/etc/tissueform/%s\n' "$config" >"$tree/DEBIAN/conffiles"
  for file in deploy/debian/{postinst,prerm,postrm}; do
    sed -e "s/@PACKAGE@/$package/g" -e "s/@USER@/$user/g" -e "s|@STATE@|$state|g" -e "s/@STARTS@/$starts/g" "$file" >"$tree/DEBIAN/$(basename "$file")"
    chmod 755 "$tree/DEBIAN/$(basename "$file")"
  done
}

write_control() {
  local package=$1 tree=$2 depends=$3 more=$4
  cat >"$tree/DEBIAN/control" <<CONTROL
Package: $package
Source: tissueform
Version: $version
Architecture: $architecture
Maintainer: The Tissueform Authors <tissueform@localhost>
Installed-Size: $(du -sk --exclude=DEBIAN "$tree" | cut -f 1)
Depends: $depends
${more}Section: science
Priority: optional
CONTROL
  cat "deploy/debian/$package.description" >>"$tree/DEBIAN/control"
}

make_package() {
  local package=$1 tree=$scratch/$1 component more="" also=""
  component=${package#tissueform-}
  mkdir -p "$tree/DEBIAN"
  case $package in
    tissueform-server)
      add_service "$package" "$tree" tissueform /var/lib/tissueform server.ini yes
      install -Dm 644 deploy/logrotate/tissueform "$tree/etc/logrotate.d/tissueform"
      echo /etc/logrotate.d/tissueform >>"$tree/DEBIAN/conffiles"
      add_man_page "$package" "$tree"
      also=", adduser"
      more=$'Suggests: tissueform-gateway, tissueform-tools\n'
      ;;
    tissueform-gateway)
      add_service "$package" "$tree" tissueform-gateway /nonexistent gateway.ini yes
      add_man_page "$package" "$tree"
      also=", adduser"
      more=$'Suggests: haproxy, tissueform-server\n'
      ;;
    tissueform-pacs)
      # It does not start by itself: the administrator must configure the PACS first.
      add_service "$package" "$tree" "$package" /var/lib/tissueform-pacs pacs.ini no
      install -Dm 644 -t "$tree/etc/tissueform" deploy/config/series-rules.json
      install -Dm 644 deploy/pacs/recipe.json "$tree/etc/tissueform/series-recipe.json"
      printf '/etc/tissueform/%s\n' series-rules.json series-recipe.json >>"$tree/DEBIAN/conffiles"
      add_man_page "$package" "$tree"
      # Pictures of predictions are drawn by the commands, on a display in memory.
      also=", adduser, tissueform-tools (= $version), xvfb, libgl1-mesa-dri"
      more=$'Suggests: haproxy, tissueform-server\n'
      ;;
    tissueform-tools)
      component=tissueform
      more=$'Recommends: tissueform-server, tissueform-gateway, xvfb, libgl1-mesa-dri\n'
      ;;
    *)
      echo "build_packages.sh: there is no package $package" >&2
      exit 2
      ;;
  esac
  cmake --install "$build" --component "$component" --prefix "$tree/usr" --strip >/dev/null
  if [[ $package == tissueform-gateway && ! -e $tree/usr/share/tissueform/web/index.html ]]; then
    echo "build_packages.sh: the planner is missing; run deploy/build_web.sh first" >&2
    exit 1
  fi
  if [[ $package == tissueform-tools ]]; then
    # The other packages have their own pages.
    rm -rf "$tree"/usr/share/man/man1/tissueform-{server,gateway,pacs}.1 "$tree/usr/share/doc/tissueform/LICENSE"
    gzip -9n "$tree"/usr/share/man/man1/*.1
  fi
  add_documents "$package" "$tree"
  add_bill "$package" "$tree"
  write_control "$package" "$tree" "$(depends_on_libraries "$tree")$also" "$more"
  (cd "$tree" && find . -type f -not -path './DEBIAN/*' -printf '%P\0' | sort -z | xargs -0 md5sum >DEBIAN/md5sums)
  dpkg-deb --root-owner-group --build "$tree" "$out/${package}_${version}_$architecture.deb" >/dev/null
  echo "$out/${package}_${version}_$architecture.deb"
}

for package in "${packages[@]}"; do
  make_package "$package"
done
