#pragma once
// Text that files bring: data URIs, names in messages.
#include <lambent/core/result.h>

#include <cstdint>
#include <string>
#include <vector>

namespace lambent {

// Text from a file between quotes, fit for a one-line message: without control characters, cut where long.
std::string in_quotes(const std::string& text);

bool is_data_uri(const std::string& uri);

// Bytes of a base64 data URI, and its media type where wanted. `where` names it in errors.
Result<std::vector<uint8_t>> decode_data_uri(const std::string& uri, const std::string& where, std::string* mime_type);

}  // namespace lambent
