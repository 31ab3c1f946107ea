#include "terminal.h"

#include <lambent/core/file.h>
#include <lambent/core/clock.h>

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>

namespace lambent::tool {
namespace {

bool colour_allowed() {
  const char* no = std::getenv("NO_COLOR");
  return ::isatty(2) && !(no && *no);
}

// "0.4%", "37%": what takes hours is seen to move within seconds.
std::string percent(double fraction) { return fmt::format("{:.{}f}%", 100 * fraction, fraction < 0.1 ? 1 : 0); }
// What is left after `run` seconds; "" where that would be a guess.
std::string time_left(double fraction, double run) {
  return fraction > 0.001 ? human_seconds(run / fraction * (1 - fraction)) + " left" : "";
}

// One line that is drawn over itself, once a stage has run for a second.
class ProgressLine {
 public:
  void operator()(const std::string& stage, double fraction) {
    const auto now = Clock::now();
    if (fraction == 0) started_ = now, drawn_ = {};
    const double run = std::chrono::duration<double>(now - started_).count();
    if (fraction >= 1) {
      if (shown_) std::fprintf(stderr, "\r\033[K"), std::fflush(stderr);
      shown_ = false;
      return;
    }
    if (run < 1 || std::chrono::duration<double>(now - drawn_).count() < 0.1) return;
    drawn_ = now, shown_ = true;
    fmt::print(stderr, "\r\033[K{}  {:>4}  {}", stage, percent(fraction), time_left(fraction, run));
    std::fflush(stderr);
  }

 private:
  Clock::time_point started_, drawn_;
  bool shown_ = false;
};

// Where nobody watches a terminal: a line of its own every few seconds, for logs.
class ProgressLog {
 public:
  void operator()(const std::string& stage, double fraction) {
    const auto now = Clock::now();
    if (fraction == 0) started_ = now;
    if (fraction >= 1 || std::chrono::duration<double>(now - said_).count() < seconds_between) return;
    said_ = now;
    const double run = std::chrono::duration<double>(now - started_).count();
    const std::string left = time_left(fraction, run);
    fmt::print(stderr, "{}  {}{}{}\n", stage, percent(fraction), left.empty() ? "" : ", ", left);
    std::fflush(stderr);
  }

 private:
  static constexpr double seconds_between = 5;
  Clock::time_point started_ = Clock::now(), said_ = Clock::now();
};

// For programs: whenever a stage begins or ends, and between five times a second.
class ProgressJson {
 public:
  void operator()(const std::string& stage, double fraction) {
    const auto now = Clock::now();
    if (fraction > 0 && fraction < 1 && std::chrono::duration<double>(now - said_).count() < 0.2) return;
    said_ = now;
    const nlohmann::json line = {{"stage", stage}, {"fraction", fraction}};
    fmt::print(stderr, "{}\n", line.dump());
    std::fflush(stderr);
  }

 private:
  Clock::time_point said_;
};

Context* interrupted = nullptr;
std::sig_atomic_t interruptions = 0;
bool quiet = false;
std::string failed_with;
std::atomic<bool> any_stage{false};  // has begun; before, files are read, which hears nothing

extern "C" void on_interrupt(int) {
  if (interrupted) interrupted->progress.cancel();
  const bool reading = interrupted && !interrupted->cleans_up && !any_stage;
  if (++interruptions > 1 || reading) {  // leave now, but leave nothing half-written
    remove_unfinished_files();
    constexpr char said[] = "lambent: cancelled\n";
    if (reading && !quiet && ::write(2, said, sizeof said - 1) < 0) ::_exit(failure);
    ::_exit(failure);
  }
}

// Tells the handler above that there is something that hears.
Progress::Report heard(Progress::Report report) {
  return [report = std::move(report)](const std::string& stage, double fraction) {
    any_stage = true;
    if (!quiet) report(stage, fraction);
  };
}

}  // namespace

Context::Context()
    : progress(heard([this, text = ::isatty(2) ? Progress::Report(ProgressLine()) : Progress::Report(ProgressLog()),
                      json_lines = ProgressJson()](const std::string& stage, double fraction) mutable {
        if (json_progress) json_lines(stage, fraction);
        else text(stage, fraction);
      })) {
  interrupted = this;
  struct sigaction action = {};
  action.sa_handler = on_interrupt;
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

int fail(const Error& error) {
  failed_with = error.text();
  if (quiet) return error.usage ? bad_usage : failure;
  fmt::print(stderr, "{} {}\n", colour_allowed() ? "\033[31mlambent:\033[0m" : "lambent:", error.text());
  return error.usage ? bad_usage : failure;
}

void warn(const std::string& message) {
  if (quiet) return;
  fmt::print(stderr, "{} {}\n", colour_allowed() ? "\033[33mwarning:\033[0m" : "warning:", message);
}
void warn(const std::vector<std::string>& messages) {
  for (const std::string& m : messages) warn(m);
}

void be_quiet() { quiet = true; }
bool is_quiet() { return quiet; }
void say_failure(const std::string& who) {
  if (quiet) fmt::print(stderr, "lambent: {}: {}\n", who, failed_with);
}

void print_json(const nlohmann::json& value) {
  fmt::print("{}\n", value.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

void print_summary(const Context& context, const Summary& summary) {
  if (context.json) return print_json(summary.json);
  size_t width = 0;
  for (const auto& [label, text] : summary.lines) width = std::max(width, label.size());
  for (const auto& [label, text] : summary.lines) fmt::print("  {:<{}}  {}\n", label, width, text);
}

}  // namespace lambent::tool
