#pragma once
// ONE table of options a request: what each is called, where it is kept, what it may be, and which kinds it goes with.
// The command line, requests in JSON, --help and docs/options.md are made from the table; check_given() refuses by name
// what a kind would leave aside, so that no option is without effect in silence.
#include <lambent/core/result.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace lambent {

// Bit k: kind k.
using KindMask = uint32_t;

template <class R>
struct Option {
  const char* name;  // "view-map": --view-map on the command line, "view_map" in JSON
  std::variant<bool R::*, int R::*, uint32_t R::*, size_t R::*, float R::*, double R::*, std::string R::*,
               std::vector<std::string> R::*>
      member;
  const char* group;  // its heading in --help
  KindMask kinds;
  const char* help;
  double low = 0, high = 0;       // numbers lie within, where low < high
  const char* choices = nullptr;  // strings are one of these, separated by |
  // "fix-view", or "receivers=texels", "bounces=converge:": the option is without effect unless that one is set, or
  // begins so (or so, after |).
  const char* needs = nullptr;
  bool recorded = true;  // false: it does not change the result, and provenance leaves it out
  bool is_path = false;  // it may name a file: of that provenance keeps the name alone
};

// Names of options that were said, as opposed to left at their defaults; as in JSON.
using GivenOptions = std::set<std::string>;

std::string json_name(const std::string& option);  // "view-map" -> "view_map"

// What a file says in JSON. Errors name the file.
Result<nlohmann::json> load_json(const std::string& path);

// "a", "b or c" ... of the kinds of a mask.
std::string kind_list(KindMask kinds, std::span<const char* const> kind_names);
// One line of docs for a value: "1 to 16", "half or single", "text".
std::string value_text(double low, double high, const char* choices);
std::vector<std::string> choices_of(const char* choices);
std::string needs_text(const std::string& needs);  // "receivers=texels" -> "--receivers texels"

namespace options_detail {

Result<void> check_number(double value, double low, double high, const std::string& name);
Result<void> check_choice(const std::string& value, const char* choices, const std::string& name);
std::string wrong_type(const std::string& expected, const nlohmann::json& value);

template <class T>
Result<T> read(const nlohmann::json& value, double low, double high, const char* choices, const std::string& name) {
  if constexpr (std::is_same_v<T, bool>) {
    if (!value.is_boolean()) return Error{name, wrong_type("true or false", value), true};
    return value.get<bool>();
  } else if constexpr (std::is_same_v<T, std::string>) {
    if (!value.is_string()) return Error{name, wrong_type("text", value), true};
    if (auto ok = check_choice(value.get<std::string>(), choices, name); !ok) return ok.error();
    return value.get<std::string>();
  } else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
    if (!value.is_array() || !std::all_of(value.begin(), value.end(), [](const auto& v) { return v.is_string(); }))
      return Error{name, wrong_type("a list of texts", value), true};
    return value.get<T>();
  } else {
    if (!value.is_number()) return Error{name, wrong_type("a number", value), true};
    const double number = value.get<double>();
    if (std::is_integral_v<T> && !(number == std::floor(number) && number >= 0 && number < 18446744073709551616.0))
      return Error{name, wrong_type("a whole number", value), true};
    if (auto ok = check_number(number, low, high, name); !ok) return ok.error();
    if (std::is_integral_v<T> && number > double(std::numeric_limits<T>::max()))
      return Error{name, wrong_type("a smaller number", value), true};
    return std::is_integral_v<T> && value.is_number_unsigned() ? T(value.get<uint64_t>()) : T(number);
  }
}

}  // namespace options_detail

// Whether the values are within what the table allows; those that were not said are.
template <class R>
Result<void> check_values(std::span<const Option<R>> table, const R& request, const GivenOptions& given) {
  for (const Option<R>& o : table) {
    if (!given.contains(json_name(o.name))) continue;
    auto ok = std::visit(
        [&](auto member) -> Result<void> {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          auto value = options_detail::read<T>(nlohmann::json(request.*member), o.low, o.high, o.choices,
                                               std::string("--") + o.name);
          if (!value) return value.error();
          return {};
        },
        o.member);
    if (!ok) return ok;
  }
  return {};
}

// "sh:3+lamps:2@/a/b.hdr" -> "sh:3+lamps:2@b.hdr".
std::string without_folder(const std::string& text);

namespace options_detail {

// Whether a value says anything: numbers within their range, texts and lists that are not empty, flags that are set.
template <class T>
bool is_set(const T& value, double low, double high) {
  if constexpr (std::is_same_v<T, bool>) return value;
  else if constexpr (std::is_arithmetic_v<T>) return !(low < high) || (double(value) >= low && double(value) <= high);
  else return !value.empty();
}

}  // namespace options_detail

// Whether the option that "name" or "name=start|start" stands for is set (and begins so).
template <class R>
bool holds(std::span<const Option<R>> table, const R& request, const std::string& condition) {
  const size_t equals = condition.find('=');
  const std::string name = condition.substr(0, equals);
  const auto o = std::find_if(table.begin(), table.end(), [&](const Option<R>& x) { return name == x.name; });
  if (o == table.end()) return false;
  return std::visit(
      [&](auto member) {
        if (equals == std::string::npos) return options_detail::is_set(request.*member, o->low, o->high);
        if constexpr (std::is_same_v<std::remove_cvref_t<decltype(request.*member)>, std::string>)
          for (const std::string& start : choices_of(condition.c_str() + equals + 1))
            if ((request.*member).starts_with(start)) return true;
        return false;
      },
      o->member);
}

// The values of all options that have an effect on a request of this kind, as they are.
template <class R>
nlohmann::json request_json(std::span<const Option<R>> table, const R& request, int kind) {
  nlohmann::json out = nlohmann::json::object();
  for (const Option<R>& o : table) {
    if (!o.recorded || !(o.kinds >> kind & 1) || (o.needs && !holds(table, request, o.needs))) continue;
    std::visit(
        [&](auto member) {
          const auto& value = request.*member;
          if (!options_detail::is_set(value, o.low, o.high)) return;
          if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, std::string>)
            out[json_name(o.name)] = o.is_path ? without_folder(value) : value;
          else out[json_name(o.name)] = value;
        },
        o.member);
  }
  return out;
}

// Sets what the object says. Errors name the field: unknown, of another type, out of range.
template <class R>
Result<void> read_request(std::span<const Option<R>> table, const nlohmann::json& object, R& request,
                          GivenOptions& given) {
  if (!object.is_object()) return Error{"", "the request is not a JSON object"};
  for (const auto& item : object.items()) {
    const std::string& key = item.key();
    const nlohmann::json& value = item.value();
    const auto o =
        std::find_if(table.begin(), table.end(), [&](const Option<R>& x) { return json_name(x.name) == key; });
    if (o == table.end()) return Error{key, "is no field of such a request", true};
    auto ok = std::visit(
        [&](auto member) -> Result<void> {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          auto read = options_detail::read<T>(value, o->low, o->high, o->choices, key);
          if (!read) return read.error();
          request.*member = std::move(*read);
          return {};
        },
        o->member);
    if (!ok) return ok;
    given.insert(key);
  }
  return {};
}

// The same from a file. Errors name it and the field.
template <class R>
Result<void> load_request(std::span<const Option<R>> table, const std::string& path, R& request, GivenOptions& given) {
  auto object = load_json(path);
  if (!object) return object.error();
  if (auto ok = read_request(table, *object, request, given); !ok)
    return Error{path, (ok.error().where.empty() ? "" : "\"" + ok.error().where + "\" ") + ok.error().message};
  return {};
}

// What was said of one request goes over what another says.
template <class R>
void say_over(std::span<const Option<R>> table, const R& said, R& request) {
  for (const Option<R>& o : table)
    if (said.given.contains(json_name(o.name)))
      std::visit([&](auto member) { request.*member = said.*member; }, o.member);
  request.given.insert(said.given.begin(), said.given.end());
}

// Every option that was said goes with the kind and has an effect, or is refused by name.
template <class R>
Result<void> check_given(std::span<const Option<R>> table, const R& request, const GivenOptions& given, int kind,
                         std::span<const char* const> kind_names) {
  for (const Option<R>& o : table) {
    if (!given.contains(json_name(o.name))) continue;
    const std::string name = std::string("--") + o.name;
    if (!(o.kinds >> kind & 1))
      return Error{
          name,
          std::string("does not go with ") + kind_names[size_t(kind)] + ": it is for " + kind_list(o.kinds, kind_names),
          true};
    if (o.needs && !holds(table, request, o.needs)) return Error{name, "needs " + needs_text(o.needs), true};
  }
  return {};
}

// Option x kind as a page of Markdown: a table a group.
template <class R>
std::string options_markdown(std::span<const Option<R>> table, std::span<const char* const> kind_names) {
  std::string out;
  const char* group = "";
  for (const Option<R>& o : table) {
    if (std::string(group) != o.group) {
      group = o.group;
      out += std::string(out.empty() ? "" : "\n") + "### " + group + "\n\n| option | value | what it does | ";
      for (const char* kind : kind_names) out += std::string(kind) + " | ";
      out.back() = '\n';
      out += "|---|---|---|" + [&] {
        std::string line;
        for (size_t k = 0; k < kind_names.size(); ++k) line += "---|";
        return line;
      }() + "\n";
    }
    const bool flag = std::holds_alternative<bool R::*>(o.member);
    std::string help = o.help;
    for (size_t at = 0; (at = help.find('|', at)) != std::string::npos; at += 2) help.insert(at, "\\");
    out += "| `--" + std::string(o.name) + "` | " + (flag ? "" : value_text(o.low, o.high, o.choices)) + " | " + help +
           " | ";
    for (size_t k = 0; k < kind_names.size(); ++k) out += o.kinds >> k & 1 ? "yes | " : "– | ";
    out.back() = '\n';
  }
  return out;
}

}  // namespace lambent
