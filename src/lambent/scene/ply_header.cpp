// The PLY polygon file format (Turk 1994).
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/ply_header.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace lambent::ply {
namespace {

bool type_from_name(std::string_view name, Type& type) {
  constexpr std::string_view names[][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                           {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                           {"float", "float32"}, {"double", "float64"}};
  for (size_t i = 0; i < std::size(names); ++i)
    if (name == names[i][0] || name == names[i][1]) return type = Type(i), true;
  return false;
}

}  // namespace

Result<Header> parse_header(std::string_view text, const std::string& path) {
  Header header;
  auto wrong = [&](std::string message) { return Error{fmt::format("{}:{}", path, header.lines), std::move(message)}; };
  bool has_format = false;
  // Lines end in LF, CR LF or, if the first one does, in CR.
  char separator = '\n';
  if (text.starts_with("ply\r") && !text.starts_with("ply\r\n")) separator = '\r';
  while (true) {
    ++header.lines;
    size_t end = text.find(separator, header.size);
    std::string_view line = text.substr(header.size, end == text.npos ? end : end - header.size), rest = line;
    std::string_view keyword = take_word(rest);
    if (header.lines == 1) {
      if (trimmed(line) != "ply") return wrong("is not a PLY file");
    } else if (keyword == "format") {
      std::string_view name = take_word(rest), version = take_word(rest);
      if (name != "ascii" && name != "binary_little_endian" && name != "binary_big_endian")
        return wrong("unknown format");
      if (version != "1.0") return wrong("version is not 1.0");
      header.format = name == "ascii"                ? Format::ascii
                    : name == "binary_little_endian" ? Format::little_endian
                                                     : Format::big_endian;
      has_format = true;
    } else if (keyword == "element") {
      Element element;
      element.name = std::string(take_word(rest)), element.line = header.lines;
      std::string_view count = take_word(rest);
      auto [stop, code] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (code != std::errc() || stop != count.data() + count.size())
        return wrong("element count is not a whole number");
      for (const Element& e : header.elements)
        if (e.name == element.name) return wrong(fmt::format("element {} comes twice", short_name(e.name)));
      header.elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (header.elements.empty()) return wrong("property before the first element");
      Property property;
      std::string_view word = take_word(rest);
      property.is_list = word == "list";
      if (property.is_list) {
        if (!type_from_name(take_word(rest), property.count_type)) return wrong("unknown type of a list's count");
        if (is_float(property.count_type)) return wrong("a list's count must be of a whole-number type");
        word = take_word(rest);
      }
      if (!type_from_name(word, property.type)) return wrong("unknown property type");
      property.name = std::string(take_word(rest));
      if (property.name.empty()) return wrong("property has no name");
      header.elements.back().properties.push_back(std::move(property));
    } else if (keyword == "comment" && take_word(rest) == "TextureFile") {
      header.textures.emplace_back(trimmed(rest));
    } else if (keyword != "comment" && keyword != "obj_info" && keyword != "end_header" && !trimmed(line).empty()) {
      return wrong("unknown header line");
    }
    if (end == text.npos && keyword != "end_header") return wrong("the header does not end");
    header.size = end == text.npos ? text.size() : end + 1;
    if (keyword == "end_header") break;
  }
  if (!has_format) return wrong("the header names no format");
  for (Element& e : header.elements) {
    bool has_lists = std::any_of(e.properties.begin(), e.properties.end(), [](const Property& p) { return p.is_list; });
    for (const Property& p : e.properties) e.row_size += has_lists ? 0 : type_size[size_t(p.type)];
  }
  return header;
}

}  // namespace lambent::ply
