#pragma once
// Text that files bring: data URIs, names of other files, names in messages.
#include <lambent/core/result.h>

#include <cstdint>
#include <string>
#include <vector>

namespace lambent {

// Text from a file between quotes, fit for a one-line message: without control characters, cut where long.
std::string in_quotes(const std::string& text);

bool is_data_uri(const std::string& uri);

// Bytes of a base64 data URI, and its media type where wanted. `where` names it in errors.
Result<std::vector<uint8_t>> decode_data_uri(const std::string& uri, const std::string& where,
                                             std::string* mime_type = nullptr);

// A file's name as a relative URI: all but letters, digits and -._~ percent-encoded, so that any bytes may be in it.
std::string encode_uri(const std::string& name);

// Where an external file is that another file names by its URI, which is percent-decoded first: in `folder`. Refused:
// absolute paths, "..", URLs, links that lead outside; all, where the folder is "".
Result<std::string> find_external_file(const std::string& uri, const std::string& folder, const std::string& referrer);
// Its bytes.
Result<std::vector<uint8_t>> read_external_file(const std::string& uri, const std::string& folder,
                                                const std::string& referrer);

}  // namespace lambent
