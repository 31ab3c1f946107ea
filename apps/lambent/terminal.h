#pragma once
// What all commands share: results on stdout, progress and messages on stderr, Ctrl-C, exit codes.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/describe.h>
#include <lambent/pipeline/text.h>

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace lambent::tool {

inline constexpr int success = 0, failure = 1, bad_usage = 2;

struct Context {
  bool json = false;
  bool json_progress = false;  // a JSON object a line, for programs: {"stage": ..., "fraction": ...}
  int threads = 0;
  bool cleans_up = false;  // the command removes what it made when it is cancelled; others end at once while they read
  Progress progress;
  Context();  // progress goes to stderr, drawn over itself on a terminal; Ctrl-C and SIGTERM cancel it
};

// "lambent: where: message" on stderr; returns `failure`, or `bad_usage` where the error is one of usage.
int fail(const Error& error);
void warn(const std::string& message);
void warn(const std::vector<std::string>& messages);

// From here on nothing is said: another rank says it. fail() keeps its message for say_failure().
void be_quiet();
bool is_quiet();
void say_failure(const std::string& who);

void print_json(const nlohmann::json& value);

// The lines, indented under whatever was said before; or the JSON.
void print_summary(const Context& context, const Summary& summary);

}  // namespace lambent::tool
