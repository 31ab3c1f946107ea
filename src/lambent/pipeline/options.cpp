#include <lambent/core/file.h>
#include <lambent/pipeline/options.h>

#include <fmt/format.h>

namespace lambent {

std::string json_name(const std::string& option) {
  std::string name = option;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

Result<nlohmann::json> load_json(const std::string& path) {
  auto bytes = read_file(path);
  if (!bytes) return bytes.error();
  nlohmann::json object = nlohmann::json::parse(bytes->begin(), bytes->end(), nullptr, false);
  if (object.is_discarded()) return Error{path, "is not JSON"};
  return object;
}

std::string kind_list(KindMask kinds, std::span<const char* const> kind_names) {
  std::vector<std::string> names;
  for (size_t k = 0; k < kind_names.size(); ++k)
    if (kinds >> k & 1) names.emplace_back(kind_names[k]);
  std::string out;
  for (size_t i = 0; i < names.size(); ++i) out += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return out;
}

std::vector<std::string> choices_of(const char* choices) {
  std::vector<std::string> out;
  if (!choices) return out;
  const std::string text = choices;
  for (size_t at = 0; at <= text.size();) {
    const size_t end = std::min(text.find('|', at), text.size());
    out.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return out;
}

std::string value_text(double low, double high, const char* choices) {
  if (low < high) return fmt::format("{:.10g} to {:.10g}", low, high);
  const std::vector<std::string> list = choices_of(choices);
  return list.empty() ? "as said" : fmt::format("{}", fmt::join(list, ", "));
}

std::string needs_text(const std::string& needs) {
  const size_t equals = needs.find('=');
  std::string out = "--" + needs.substr(0, equals);
  if (equals != std::string::npos) out += fmt::format(" {}", fmt::join(choices_of(needs.c_str() + equals + 1), " or "));
  return out;
}

std::string without_folder(const std::string& text) {
  const size_t slash = text.find_last_of('/');
  if (slash == std::string::npos) return text;
  const size_t prefix = text.find_last_of("@:", slash);
  return (prefix == std::string::npos ? "" : text.substr(0, prefix + 1)) + text.substr(slash + 1);
}

namespace options_detail {

Result<void> check_number(double value, double low, double high, const std::string& name) {
  if (!std::isfinite(value)) return Error{name, "is not a finite number", true};
  if (low < high && !(value >= low && value <= high))
    return Error{name, fmt::format("must lie between {:.10g} and {:.10g}, not {:.10g}", low, high, value), true};
  return {};
}

Result<void> check_choice(const std::string& value, const char* choices, const std::string& name) {
  if (!choices) return {};
  const std::vector<std::string> list = choices_of(choices);
  if (std::find(list.begin(), list.end(), value) != list.end()) return {};
  return Error{name, fmt::format("must be one of {}, not \"{}\"", fmt::join(list, ", "), value), true};
}

std::string wrong_type(const std::string& expected, const nlohmann::json& value) {
  std::string text = value.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  if (text.size() > 80) text = text.substr(0, 77) + "...";
  return "expects " + expected + ", not " + text;
}

}  // namespace options_detail

}  // namespace lambent
