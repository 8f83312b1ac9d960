#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the Debian packages into build/deb: packaging/build-deb.sh [--with-tests]
set -euo pipefail
cd "$(dirname "$0")/.."
options=nocheck
if [[ ${1:-} == --with-tests ]]; then options=; fi
version=$(sed -n '1s/.*(\(.*\)-.*/\1/p' packaging/debian/changelog)
out=$PWD/build/deb
source=$out/diorama-$version
rm -rf "$out"
mkdir -p "$source"
git ls-files -z | xargs -0 cp --parents -t "$source"
tar -C "$out" --sort=name --mtime=@0 --owner=0 --group=0 -czf "$out/diorama_$version.orig.tar.gz" \
  "diorama-$version"
cp -r packaging/debian "$source/debian"
cd "$source"
DEB_BUILD_OPTIONS="$options parallel=$(nproc)" dpkg-buildpackage -us -uc
cd "$out"
lintian --info --display-info --fail-on error,warning ./*.changes
ls -l ./*.deb
