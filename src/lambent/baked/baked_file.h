#pragma once
// The baked file: a glTF 2.0 binary that any viewer opens, the input's scene kept, with the transfer in the extension
// LAMBENT_transfer (docs/file-format.md; schema in docs/schema/).
#include <lambent/core/file.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/outgoing.h>
#include <lambent/transfer/transfer.h>
#include <lambent/transfer/zonal_transfer.h>

#include <optional>
#include <string>

namespace lambent {

inline constexpr int baked_file_version = 1;

struct Baked {
  Scene scene;
  std::vector<uint32_t> front, back;  // receiver of each scene vertex, by side, as in Receivers
  Transfer transfer;                  // read in place: its data lies in the mapped file
  std::optional<Outgoing> outgoing;   // the last reflection of a transfer matrix; none: diffuse transfer
  std::optional<ZonalTransfer> zonal;  // in place of `transfer`, which then has no receivers; read in place too
  std::string provenance;             // JSON text: inputs and their hashes, options, version, what the bake reported
};

// Errors: the disk's; more than 4 GiB, which a GLB cannot hold.
// `outgoing` belongs to a transfer matrix; null for diffuse transfer.
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers, const Transfer& transfer,
                        const std::string& provenance, const Outgoing* outgoing = nullptr);
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers, const ZonalTransfer& transfer,
                        const std::string& provenance);

// Errors: not a baked file, another version, anything that does not fit.
Result<Baked> load_baked(const std::string& path);
Result<Baked> load_baked(const MappedFile& file, const std::string& path);

// Whether the file is a glTF with our extension; false for anything else, unreadable files too.
bool is_baked(const std::string& path);

}  // namespace lambent
