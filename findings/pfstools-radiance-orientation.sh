#!/usr/bin/env bash
# pfstools 2.2.0 (Debian 12: 2.2.0-5+b1), pfsinrgbe, Radiance pictures whose rows and columns do not begin at the top
# left.
#
# Expected: the resolution line of a Radiance picture has eight forms ("-Y 2 +X 3", "+Y 2 +X 3", "+X 3 -Y 2", ...),
# which say from which corner pixels are counted and which way they run first; a reader puts each pixel in its place.
#
# Seen: the signs and the order of the axes are read past. "+Y", rows from below, comes out as it would for "-Y": upside
# down. "+X 3 -Y 2", columns first, comes out as a picture of 2 x 3 instead of 3 x 2. No warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq pfstools=2.2.0-5+b1 libpfs2=2.2.0-5+b1 >/dev/null 2>&1
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH=$folder/root/usr/lib
# Three columns and two rows; the stored order is 1 2 3 / 4 5 6, as powers of two in all three channels.
pixels='\x80\x80\x80\x81\x80\x80\x80\x82\x80\x80\x80\x83\x80\x80\x80\x84\x80\x80\x80\x85\x80\x80\x80\x86'
picture() { printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n%s\n' "$1" >"$2"; printf "$pixels" >>"$2"; }
# Size, then the first channel's values, from pfs's own stream: a header, then floats, a channel at a time.
read_back() {
  root/usr/bin/pfsinrgbe "$1" | python3 -c '
import struct, sys
data = sys.stdin.buffer.read()
width, height = (int(n) for n in data.split(b"\n")[1].split())
end = data.index(b"ENDH") + 4
values = struct.unpack_from("<%df" % (width * height), data, end)
print(width, height, *[round(v / values[0], 2) for v in values])'
}
picture '-Y 2 +X 3' plain.hdr
picture '+Y 2 +X 3' below.hdr
picture '+X 3 -Y 2' columns.hdr
plain=$(read_back plain.hdr) below=$(read_back below.hdr) columns=$(read_back columns.hdr)
printf '%s\n' "-Y +X: $plain" "+Y +X: $below" "+X -Y: $columns"
[ "$below" = "$plain" ] || { echo "rows from below are no longer read as from above"; exit 1; }
case $columns in
  '2 3 '*) ;;
  *) echo "columns first no longer give a picture of 2 x 3"; exit 1 ;;
esac
echo "as described: pfsinrgbe 2.2.0 reads past the orientation of a Radiance picture"
