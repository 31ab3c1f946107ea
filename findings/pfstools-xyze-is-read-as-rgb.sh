#!/usr/bin/env bash
# pfstools 2.2.0 (Debian 12: 2.2.0-5+b1), pfsinrgbe, a Radiance picture of FORMAT=32-bit_rle_xyze.
#
# Expected: pixels of such a picture are CIE X, Y and Z. pfs streams hold X, Y and Z too, so that they pass through: a
# pixel of X = Y = Z = 1 stays that.
#
# Seen: the FORMAT line is read past, and the three numbers are taken for red, green and blue and turned into X, Y, Z
# once more: 0.9505, 1, 1.0890, the white of D65. No warning. Colours of maps made by Radiance's ra_xyze shift.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq pfstools=2.2.0-5+b1 libpfs2=2.2.0-5+b1 >/dev/null 2>&1
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH=$folder/root/usr/lib
{ printf '#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n'; printf '\x80\x80\x80\x81'; } >xyz.hdr
root/usr/bin/pfsinrgbe xyz.hdr 2>said.txt | python3 -c '
import struct, sys
data = sys.stdin.buffer.read()
x, y, z = struct.unpack_from("<3f", data, data.index(b"ENDH") + 4)
x, z = x / y, z / y
print("X / Y = %.4f, Z / Y = %.4f" % (x, z))
assert abs(x - 0.9505) < 0.001 and abs(z - 1.0888) < 0.001, "XYZE is no longer taken for RGB"'
[ ! -s said.txt ] || { echo "the tool now says something"; exit 1; }
echo "as described: pfsinrgbe 2.2.0 takes XYZE for RGB"
