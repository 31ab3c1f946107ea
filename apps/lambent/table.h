#pragma once
// Options of a command from the table of its request (pipeline/options.h).
#include <lambent/pipeline/options.h>

#include <CLI/CLI.hpp>

#include <functional>
#include <map>
#include <string>

namespace lambent::tool {

// Seconds may be said with a unit: 90, 90s, 1.5min, 2h.
inline CLI::AsNumberWithUnit as_seconds() {
  const std::map<std::string, double> units{{"s", 1}, {"min", 60}, {"m", 60}, {"h", 3600}};
  return CLI::AsNumberWithUnit(units, CLI::AsNumberWithUnit::CASE_INSENSITIVE, "TIME");
}

// Adds the options of the table that `takes` to the command, in the table's groups; what is said goes into `request`,
// and its name into `given` once the command line has been read.
template <class R>
void add_table(CLI::App& command, std::span<const Option<R>> table, R& request, GivenOptions& given,
               const std::function<bool(const std::string&)>& takes) {
  for (const Option<R>& o : table) {
    if (!takes(o.name)) continue;
    const std::string name = std::string(o.name) == "output" ? "-o,--output" : std::string("--") + o.name;
    std::string help = o.help;
    if (o.choices) help += " {" + value_text(0, 0, o.choices) + "}";
    CLI::Option* option = std::visit(
        [&](auto member) -> CLI::Option* {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          if constexpr (std::is_same_v<T, bool>) return command.add_flag(name, request.*member, help);
          else if constexpr (std::is_same_v<T, size_t>)
            return command.add_option(name, request.*member, help)
                ->transform(CLI::AsSizeValue(false))
                ->transform(CLI::Validator(  // before the other, which takes -1 for the greatest of numbers
                    [](std::string& said) { return said.starts_with('-') ? "must not be below 0" : ""; }, ""));
          else if constexpr (std::is_same_v<T, std::vector<std::string>>)  // one each time that it is said
            return command.add_option(name, request.*member, help)->allow_extra_args(false);
          else return command.add_option(name, request.*member, help);
        },
        o.member);
    option->group(o.group);
    if (name == "--time") option->transform(as_seconds());
    // What most people leave as it is, said once.
    std::visit(
        [&](auto member) {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          if constexpr (std::is_same_v<T, std::string>) {
            if (!(request.*member).empty()) option->default_str(request.*member);
          } else if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool> && !std::is_same_v<T, size_t>) {
            if (options_detail::is_set(request.*member, o.low, o.high)) option->capture_default_str();
          }
        },
        o.member);
    option->each([&given, key = json_name(o.name)](const std::string&) { given.insert(key); });
  }
}

}  // namespace lambent::tool
