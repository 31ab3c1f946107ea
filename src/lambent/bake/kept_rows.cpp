#include <lambent/bake/kept_rows.h>

#include <lambent/bake/shared_exponent.h>
#include <lambent/core/half.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace lambent {
namespace {

constexpr size_t large_page = size_t{1} << 21;
constexpr uint8_t last_of_column = 0x80;

struct PackedHeader {
  uint32_t rows = 0, columns = 0, entries = 0, steps = 0;  // steps: bytes of them
};

size_t weight_bytes(int channels) { return channels == 3 ? 4 : 2; }

// A file without a name: it goes with the process, however that ends.
int open_scratch(const std::string& folder) {
  int fd = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd >= 0) return fd;
  std::string name = folder + "/.lambent-rows-XXXXXX";
  fd = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd >= 0) ::unlink(name.c_str());
  return fd;
}

bool write_at(int fd, std::span<const uint8_t> bytes, size_t at) {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t put = ::pwrite(fd, bytes.data() + done, bytes.size() - done, off_t(at + done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return false;
    done += size_t(put);
  }
  return true;
}

bool read_at(int fd, std::span<uint8_t> bytes, size_t at) {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t got = ::pread(fd, bytes.data() + done, bytes.size() - done, off_t(at + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    done += size_t(got);
  }
  return true;
}

}  // namespace

size_t most_bytes(size_t rays, size_t receivers, int channels) {
  const size_t entries = gather_block * std::min(3 * rays, receivers);
  // An entry, a column of its own at worst, and half as much again by the half-sample rows.
  return 3 * entries / 2 * (6 + weight_bytes(channels)) + 128;
}

void pack(const SparseBlock& block, std::vector<uint8_t>& out) {
  PackedHeader h{uint32_t(block.row_count), uint32_t(block.columns.size()), uint32_t(block.rows.size())};
  const int channels = block.weights.size() > block.rows.size() ? 3 : 1;
  const size_t weights = block.rows.size() * weight_bytes(channels);
  out.resize(sizeof h + 5 * block.columns.size() + block.rows.size() + weights + 1);
  uint8_t* at = out.data() + sizeof h;
  uint32_t last = 0;
  for (const uint32_t column : block.columns) {
    uint32_t step = column - last;
    for (; step >= 0x80; step >>= 7) *at++ = uint8_t(step | 0x80);
    *at++ = uint8_t(step);
    last = column;
  }
  h.steps = uint32_t(at - out.data() - sizeof h);
  if (!block.rows.empty()) std::memcpy(at, block.rows.data(), block.rows.size());
  for (const uint32_t end : block.ends) at[end - 1] |= last_of_column;
  at += block.rows.size();
  if (channels == 1) {
    if (weights) std::memcpy(at, block.weights.data(), weights);
    at += weights;
  } else {
    for (size_t e = 0; e < block.rows.size(); ++e, at += 4) {
      const uint16_t* w = block.weights.data() + 3 * e;
      const float rgb[3] = {half_to_float(w[0]), half_to_float(w[1]), half_to_float(w[2])};
      const uint32_t bits = pack_shared(rgb);
      std::memcpy(at, &bits, sizeof bits);
    }
  }
  std::memcpy(out.data(), &h, sizeof h);
  out.resize(size_t(at - out.data()));
}

bool unpack(std::span<const uint8_t> bytes, size_t receivers, int channels, SparseBlock& out) {
  PackedHeader h;
  if (bytes.size() < sizeof h) return false;
  std::memcpy(&h, bytes.data(), sizeof h);
  const size_t weights = size_t(h.entries) * size_t(channels);
  if (h.rows > gather_block || h.columns > h.entries ||
      bytes.size() != sizeof h + size_t(h.steps) + h.entries + h.entries * weight_bytes(channels))
    return false;
  out.row_count = h.rows;
  out.columns.resize(h.columns), out.ends.resize(h.columns), out.rows.resize(h.entries), out.weights.resize(weights);
  const uint8_t *at = bytes.data() + sizeof h, *const steps_end = at + h.steps;
  uint64_t column = 0;
  for (uint32_t& c : out.columns) {
    uint64_t step = 0;
    for (int shift = 0;; shift += 7) {
      if (at == steps_end || shift > 28) return false;
      const uint8_t byte = *at++;
      step |= uint64_t(byte & 0x7f) << shift;
      if (byte < 0x80) break;
    }
    column += step;
    if (column >= receivers) return false;
    c = uint32_t(column);
  }
  if (at != steps_end) return false;
  uint32_t ends = 0;
  for (uint32_t e = 0; e < h.entries; ++e) {
    const uint8_t row = at[e] & uint8_t(~last_of_column);
    if (row >= h.rows) return false;
    out.rows[e] = row;
    if (at[e] & last_of_column) {
      if (ends == h.columns) return false;
      out.ends[ends++] = e + 1;
    }
  }
  if (ends != h.columns || (h.columns ? out.ends.back() != h.entries : h.entries != 0)) return false;
  at += h.entries;
  if (channels == 1) {
    if (weights) std::memcpy(out.weights.data(), at, 2 * weights);
    return true;
  }
  thread_local std::vector<float> floats;
  floats.resize(weights);
  for (size_t e = 0; e < h.entries; ++e) {
    uint32_t bits;
    std::memcpy(&bits, at + 4 * e, sizeof bits);
    unpack_shared(bits, floats.data() + 3 * e);
  }
  floats_to_halves(floats.data(), weights, out.weights.data());
  return true;
}

KeptRows::KeptRows(size_t blocks, size_t budget, size_t most_bytes_a_block, const std::string& scratch)
    : places_(blocks) {
  const size_t most = blocks > 0 && most_bytes_a_block > SIZE_MAX / 2 / blocks ? SIZE_MAX / 2
                                                                               : blocks * most_bytes_a_block;
  if (!scratch.empty() && most_bytes_a_block > 0) file_ = open_scratch(scratch);
  reserved_ = std::min({budget, most, size_t{1} << 46}) / large_page * large_page;
  if (reserved_ == 0) reserved_ = std::min(budget, most) / 4096 * 4096;
  if (reserved_ == 0) return;
  void* p = ::mmap(nullptr, reserved_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (p == MAP_FAILED) {
    reserved_ = 0;  // no rows are kept in memory
    return;
  }
  memory_ = static_cast<std::byte*>(p);
  ::madvise(p, reserved_, MADV_HUGEPAGE);
}

KeptRows::~KeptRows() {
  if (memory_) ::munmap(memory_, reserved_);
  if (file_ >= 0) ::close(file_);
}

bool KeptRows::keep(size_t block, const PackedBlock& rows) {
  const size_t bytes = rows.rows.size() + rows.half_rows.size();
  Place place{0, uint32_t(rows.rows.size()), uint32_t(rows.half_rows.size())};
  size_t at = used_.load();
  bool fits = bytes <= reserved_ - at;
  while (fits && !used_.compare_exchange_weak(at, at + bytes)) fits = bytes <= reserved_ - at;
  if (fits) {
    std::byte* to = memory_ + at;
    if (!rows.rows.empty()) std::memcpy(to, rows.rows.data(), rows.rows.size());
    if (!rows.half_rows.empty()) std::memcpy(to + rows.rows.size(), rows.half_rows.data(), rows.half_rows.size());
    place.at = at, place.where = Place::Where::memory;
    places_[block] = place;
    return true;
  }
  if (file_ < 0 || file_full_) return false;
  place.at = filed_.fetch_add(bytes);
  if (!write_at(file_, rows.rows, place.at) || !write_at(file_, rows.half_rows, place.at + rows.rows.size())) {
    file_full_ = true;
    return false;
  }
  place.where = Place::Where::file;
  places_[block] = place;
  return true;
}

bool KeptRows::find(size_t block, std::vector<uint8_t>& buffer, Block& out) const {
  const Place& place = places_[block];
  if (place.where == Place::Where::nowhere) return false;
  const uint8_t* from = nullptr;
  if (place.where == Place::Where::memory) {
    from = reinterpret_cast<const uint8_t*>(memory_ + place.at);
  } else {
    buffer.resize(size_t(place.rows) + place.half_rows);
    if (!read_at(file_, buffer, place.at)) return false;
    from = buffer.data();
  }
  out = {{from, place.rows}, {from + place.rows, place.half_rows}};
  return true;
}

size_t KeptRows::count() const {
  return size_t(std::count_if(places_.begin(), places_.end(),
                              [](const Place& place) { return place.where != Place::Where::nowhere; }));
}

double KeptRows::fraction() const { return places_.empty() ? 1.0 : double(count()) / double(places_.size()); }

}  // namespace lambent
