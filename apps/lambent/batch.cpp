// `lambent batch`: many requests, each by a process of its own, so that one that fails or is killed costs itself alone.
#include "commands.h"

#include <lambent/baked/fields.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/pipeline/durable.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/place_receivers.h>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

namespace lambent::tool {
namespace {

namespace fs = std::filesystem;

struct BatchCommand {
  std::string manifest;
  int jobs = 1;
  bool resume = false;
};

struct BatchJob {
  size_t line = 0;
  BakeRequest request{};  // resolved
  nlohmann::json said{};
  std::string state{}, why{};  // baked, skipped, failed; of the last, its error
  double seconds = 0;
  uintmax_t bytes = 0;
  pid_t process = 0;
  int said_on = -1;  // its stderr
  Clock::time_point since{};
};

Result<std::vector<BatchJob>> read_manifest(const std::string& path) {
  auto bytes = read_file(path);
  if (!bytes) return bytes.error();
  std::vector<BatchJob> jobs;
  std::map<std::string, size_t> lines;  // of outputs
  size_t number = 0;
  for (auto at = bytes->begin(); at != bytes->end();) {
    const auto end = std::find(at, bytes->end(), uint8_t('\n'));
    const std::string line(at, end);
    at = end == bytes->end() ? end : end + 1;
    ++number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::string where = path + ":" + std::to_string(number);
    const auto said = nlohmann::json::parse(line, nullptr, false);
    if (!said.is_object()) return Error{where, "is not a JSON object"};
    auto request = bake_request_from_json(said);
    if (request) request = resolved(std::move(*request));
    if (!request) return Error{where, request.error().text()};
    if (request->scene.empty() || request->output.empty()) return Error{where, "needs \"scene\" and \"output\""};
    if (auto ok = check_output(request->output, {"glb", "gltf"}); !ok) return Error{where, ok.error().text()};
    const auto [first, is_new] = lines.emplace(fs::absolute(request->output).lexically_normal().string(), number);
    if (!is_new) return Error{where, fmt::format("writes {}, as line {} does", request->output, first->second)};
    jobs.push_back({number, std::move(*request), said});
  }
  if (jobs.empty()) return Error{path, "has no request"};
  return jobs;
}

std::string depfile_of(const BatchJob& job) {
  return job.request.depfile.empty() ? job.request.output + ".d" : job.request.depfile;
}

// Whether the output is of this request and these inputs: by their hashes, and those of files that only the scene names
// by their times.
bool is_done(const BatchJob& job) {
  const BakeRequest& r = job.request;
  auto file = MappedFile::open(r.output);
  if (!file) return false;
  auto fields = read_fields(*file, r.output);
  if (!fields) return false;
  const auto there = nlohmann::json::parse(fields->provenance, nullptr, false);
  auto scene = MappedFile::open(r.scene);
  if (!there.is_object() || !scene) return false;
  Scene named;  // as much of it as its provenance needs
  named.path = r.scene, named.hash = content_hash(scene->bytes());
  auto mine = nlohmann::json::parse(provenance_of(r, named, nlohmann::json::object()), nullptr, false);
  for (const char* key : {"generator", "input", "request", "inputs"})
    if (there.value(key, nlohmann::json()) != mine.value(key, nlohmann::json())) return false;
  std::error_code status;
  const auto written = fs::last_write_time(r.output, status);
  if (status) return false;
  auto rule = read_file(depfile_of(job));
  if (!rule) return true;
  for (const std::string& input : files_of_depfile(std::string(rule->begin(), rule->end())))
    if (fs::last_write_time(input, status) > written || status) return false;
  return true;
}

void start(BatchJob& job, bool resume, int threads) {
  nlohmann::json request = job.said;
  request["depfile"] = depfile_of(job);
  if (resume && !request.contains("checkpoint")) {
    const std::string folder = checkpoint_folder(job.request);
    if (!folder.empty()) request["checkpoint"] = folder;
  }
  const std::string text = request.dump();
  const int in = ::memfd_create("request", MFD_CLOEXEC), out = ::memfd_create("messages", MFD_CLOEXEC);
  job.since = Clock::now();
  if (in < 0 || out < 0 || ::write(in, text.data(), text.size()) != ssize_t(text.size())) {
    job.state = "failed", job.why = std::strerror(errno);
    return;
  }
  const std::string count = std::to_string(threads);
  const pid_t parent = ::getpid();
  job.process = ::fork();
  if (job.process == 0) {
    ::setpgid(0, 0);  // an interrupt reaches it once, by us
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(failure);
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    ::dup2(nothing, 0), ::dup2(nothing, 1), ::dup2(out, 2);
    const int kept = ::dup(in);  // without FD_CLOEXEC
    const std::string named = "/proc/self/fd/" + std::to_string(kept);
    ::execl("/proc/self/exe", "lambent", "--threads", count.c_str(), "bake", "--request", named.c_str(), nullptr);
    ::_exit(failure);
  }
  ::close(in);
  if (job.process < 0) job.state = "failed", job.why = std::strerror(errno), job.process = 0;
  job.said_on = out;
}

// What a process said on stderr, line by line, without its progress.
std::vector<std::string> messages_of(int fd) {
  std::string all;
  char buffer[4096];
  size_t at = 0;
  for (ssize_t got; (got = ::pread(fd, buffer, sizeof buffer, off_t(at))) > 0; at += size_t(got))
    all.append(buffer, size_t(got));
  std::vector<std::string> lines;
  for (size_t begin = 0; begin < all.size();) {
    const size_t end = std::min(all.find('\n', begin), all.size());
    std::string line = all.substr(begin, end - begin);
    if (line.starts_with("warning: ") || line.starts_with("lambent: ")) lines.push_back(std::move(line));
    begin = end + 1;
  }
  return lines;
}

void end(BatchJob& job, int status) {
  job.seconds = std::chrono::duration<double>(Clock::now() - job.since).count();
  job.process = 0;
  for (const std::string& line : messages_of(job.said_on))
    if (line.starts_with("warning: ")) warn(job.request.output + ": " + line.substr(9));
    else job.why = line.substr(9);
  ::close(job.said_on);
  const bool well = WIFEXITED(status) && WEXITSTATUS(status) == success;
  if (WIFSIGNALED(status)) job.why = fmt::format("ended by signal {}", WTERMSIG(status));
  job.state = well ? "baked" : "failed";
  if (well) job.bytes = bytes_on_disk(job.request.output), job.why.clear();
}

void tell(const BatchJob& job, size_t done, size_t all) {
  fmt::print(stderr, "[{}/{}] {}  {}{}{}\n", done, all, job.request.output, job.state,
             job.state == "baked" ? " in " + human_seconds(job.seconds) : "", job.why.empty() ? "" : ": " + job.why);
  std::fflush(stderr);
}

void run_all(Context& context, const BatchCommand& o, std::vector<BatchJob>& jobs) {
  const int threads = context.threads > 0 ? context.threads : std::max(1, thread_count() / o.jobs);
  size_t next = 0, done = 0;
  int running = 0;
  bool told = false;
  while (done < jobs.size()) {
    const bool cancelled = context.progress.cancelled();
    while (running < o.jobs && next < jobs.size() && !cancelled) {
      BatchJob& job = jobs[next++];
      if (is_done(job)) job.state = "skipped", job.why = "it is there";
      else start(job, o.resume, threads);
      if (job.process) ++running;
      else tell(job, ++done, jobs.size());
    }
    if (cancelled && !told)
      for (BatchJob& job : jobs)
        if (job.process) ::kill(job.process, SIGINT);
    told |= cancelled;
    for (BatchJob& job : jobs) {
      int status = 0;
      if (!job.process || ::waitpid(job.process, &status, WNOHANG) != job.process) continue;
      end(job, status), --running;
      tell(job, ++done, jobs.size());
    }
    if (cancelled && running == 0) break;
    if (running > 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  for (BatchJob& job : jobs)
    if (job.state.empty()) job.state = "not begun";
}

int run_batch(Context& context, const BatchCommand& o) {
  context.cleans_up = true;
  auto jobs = read_manifest(o.manifest);
  if (!jobs) return fail(jobs.error());
  run_all(context, o, *jobs);
  std::map<std::string, size_t> counts;
  nlohmann::json table = nlohmann::json::array();
  for (const BatchJob& job : *jobs) {
    ++counts[job.state];
    table.push_back({{"line", job.line},
                     {"output", job.request.output},
                     {"state", job.state},
                     {"seconds", job.seconds},
                     {"bytes", job.bytes}});
    if (!job.why.empty()) table.back()["why"] = job.why;
  }
  if (context.json) {
    print_json({{"jobs", table}, {"counts", counts}});
  } else {
    size_t width = 6;
    for (const BatchJob& job : *jobs) width = std::max(width, job.request.output.size());
    fmt::print("{:<{}}  state      time       size\n", "output", width);
    for (const BatchJob& job : *jobs)
      fmt::print("{:<{}}  {:<9}  {:<9}  {}\n", job.request.output, width, job.state,
                 job.seconds > 0 ? human_seconds(job.seconds) : "", job.bytes ? human_bytes(double(job.bytes)) : "");
    std::string all;
    for (const auto& [state, count] : counts) all += fmt::format("{}{} {}", all.empty() ? "" : ", ", count, state);
    fmt::print("{}\n", all);
  }
  return counts["failed"] + counts["not begun"] > 0 ? failure : success;
}

}  // namespace

void add_batch(CLI::App& app, Run& run) {
  auto o = std::make_shared<BatchCommand>();
  CLI::App* c = app.add_subcommand("batch", "Bake many requests, and leave out what is there already");
  c->add_option("manifest", o->manifest, "A request a line, in JSON, as `bake --request` takes one")->required();
  c->add_option("--jobs", o->jobs, "Bakes side by side; they share the threads")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  c->add_flag("--resume", o->resume,
              "Keep the work of every job from its start, and go on where an earlier batch was cut short");
  c->callback([o, &run] { run = [o](Context& context) { return run_batch(context, *o); }; });
}

}  // namespace lambent::tool
