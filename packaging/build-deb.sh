#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the Debian packages into build/deb and checks them with lintian.
#   packaging/build-deb.sh                all binary packages
#   packaging/build-deb.sh --with-tests   the same; every test must pass first
#   packaging/build-deb.sh --source       the source package alone, for building it elsewhere
# A compiler cache may be given as CMake has it: CMAKE_CXX_COMPILER_LAUNCHER=ccache (with CCACHE_DIR,
# as package builds have no home).
set -euo pipefail
cd "$(dirname "$0")/.."
usage() { sed -n '3,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mode=${1:-}
if (($# > 1)); then usage; fi

# Installs what packing needs and is absent. sudo only when not root.
as_root() { if ((EUID == 0)); then "$@"; else sudo "$@"; fi; }
tools=(dpkg-dev debhelper fakeroot lintian)
has_all() { dpkg -s "${tools[@]}" && { [[ $mode == --source ]] || dpkg-checkbuilddeps packaging/debian/control; }; }
if ! has_all >/dev/null 2>&1; then
  as_root apt-get update -qq
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${tools[@]}" >/dev/null
  if [[ $mode != --source ]]; then  # of the folder with debian/control
    as_root env DEBIAN_FRONTEND=noninteractive apt-get build-dep -y -qq ./packaging >/dev/null
  fi
fi

version=$(sed -n '1s/.*(\(.*\)-.*/\1/p' packaging/debian/changelog)
out=$PWD/build/deb
source=$out/diorama-$version
rm -rf "$out"
mkdir -p "$source"
# As root in a clone of somebody else, too.
git -c "safe.directory=*" ls-files -z | xargs -0 cp --parents -t "$source"
# The same bytes for the same sources; files of the packages get this date.
date=$(dpkg-parsechangelog -l packaging/debian/changelog -S Timestamp)
tar -C "$out" --sort=name --mtime="@$date" --owner=0 --group=0 -czf "$out/diorama_$version.orig.tar.gz" \
  "diorama-$version"
cp -r packaging/debian "$source/debian"

cd "$source"
export DEB_BUILD_OPTIONS="parallel=$(nproc)"
case $mode in
  --source) exec dpkg-buildpackage --no-sign --no-check-builddeps --build=source ;;
  --with-tests) ;;
  '') export DEB_BUILD_OPTIONS="$DEB_BUILD_OPTIONS nocheck" DEB_BUILD_PROFILES=nocheck ;;
  *) usage ;;
esac
dpkg-buildpackage --no-sign
cd "$out"
lintian --info --fail-on error,warning ./*.changes
ls -l ./*.deb
