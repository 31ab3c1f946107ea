#include <lambent/pipeline/durable.h>

#include <lambent/core/ranks.h>
#include <lambent/pipeline/version.h>

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>

namespace lambent {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double long_work = 60;  // seconds, from which a bake is kept without being asked
constexpr const char *ending = ".checkpoint", *none_wanted = "off";

std::string dump(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

// Bytes of a result depend on the program and, in rounding, on the processor's vectors.
const std::string& build_name() {
  static const std::string name = [] {
    std::string out = std::string("lambent ") + version;
    if (auto program = MappedFile::open("/proc/self/exe")) out += " " + content_hash(program->bytes());
#if defined(__x86_64__)
    for (const auto& [there, what] :
         {std::pair(__builtin_cpu_supports("avx2"), " avx2"), std::pair(__builtin_cpu_supports("fma"), " fma"),
          std::pair(__builtin_cpu_supports("avx512f"), " avx512")})
      if (there) out += what;
#endif
    return out;
  }();
  return name;
}

// {name, path, xxh3_128} of each file.
Result<json> hashed(const std::vector<std::string>& paths) {
  json out = json::array();
  for (const std::string& path : paths) {
    auto file = MappedFile::open(path);
    if (!file) return file.error();
    out.push_back({{"name", fs::path(path).filename().string()},
                   {"path", fs::absolute(path).lexically_normal().string()},
                   {"xxh3_128", content_hash(file->bytes())}});
  }
  return out;
}

// Names and hashes alone, in an order of their own: paths differ with where one stands.
std::set<std::pair<std::string, std::string>> contents(const json& inputs) {
  std::set<std::pair<std::string, std::string>> out;
  if (inputs.is_array())
    for (const json& input : inputs)
      if (input.is_object()) out.emplace(dump(input.value("name", json())), dump(input.value("xxh3_128", json())));
  return out;
}

// Why a checkpoint is not one of this work; "": it is.
std::string difference(const json& there, const json& mine) {
  if (!there.is_object() || !there.contains("request") || !there["request"].is_object()) return "is not readable";
  const json &theirs = there["request"], &ours = mine["request"];
  for (const json* request : {&theirs, &ours})
    for (const auto& item : request->items()) {
      const json here = ours.value(item.key(), json()), other = theirs.value(item.key(), json());
      // As text: what is no UTF-8 was replaced when it was written.
      if (dump(here) != dump(other))
        return fmt::format("is of another request: {} was {}, and is {}", item.key(), dump(other), dump(here));
    }
  const auto theirs_read = contents(there.value("inputs", json())), ours_read = contents(mine["inputs"]);
  for (const auto& input : ours_read)
    if (!theirs_read.contains(input)) return "is of another input: " + input.first + " has changed";
  if (theirs_read != ours_read) return "is of other inputs";
  if (there.value("build", json()) != mine["build"])
    return "is of another build of lambent, or another kind of processor";
  return "";
}

json read_identity(std::span<const uint8_t> bytes) { return json::parse(bytes.begin(), bytes.end(), nullptr, false); }

}  // namespace

std::string checkpoint_folder(const BakeRequest& request) {
  if (request.checkpoint == none_wanted || kind_of(request) == BakeKind::membrane) return {};
  return request.checkpoint.empty() ? request.output + ending : request.checkpoint;
}

DurableBake::DurableBake(const BakeRequest& request, const Job& job) : request_(request), given_(job), own_(job) {
  build_name();  // before what is read counts as an input
  own_.progress = job.progress ? job.progress : &silent_;
  own_.progress->scratch = request.scratch == none_wanted ? std::string()
                         : request.scratch.empty()        ? folder_of(request.output)
                                                          : request.scratch;
  own_.inputs_read = [this](const std::vector<std::string>& pictures) { return begin(pictures); };
  // Those that are read late are inputs from the start.
  for (const Option<BakeRequest>& o : bake_options()) {
    const auto* member = std::get_if<std::string BakeRequest::*>(&o.member);
    if (!member || !o.is_path) continue;
    const std::string& value = request.*(*member);
    const size_t prefix = value.find_last_of("@:");
    struct stat info;
    for (const std::string& path : {value, prefix == std::string::npos ? value : value.substr(prefix + 1)})
      if (::stat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode)) ReadLog::note(path, info.st_dev, info.st_ino);
  }
}

DurableBake::~DurableBake() { own_.progress->checkpoint = nullptr, own_.progress->scratch.clear(); }

std::vector<std::string> DurableBake::inputs() const {
  std::vector<std::string> out;
  std::set<std::pair<uint64_t, uint64_t>> seen;
  for (const ReadFile& file : log_.files())
    if (seen.emplace(file.device, file.inode).second && !file.path.starts_with("/proc/")) out.push_back(file.path);
  return out;
}

Result<void> DurableBake::begin(const std::vector<std::string>& pictures) {
  std::error_code status;
  if (!own_.progress->scratch.empty() && !fs::is_directory(own_.progress->scratch, status))
    return Error{"--scratch", "is no folder: " + own_.progress->scratch, true};
  const std::string stem = request_.output.substr(0, request_.output.find_last_of('.'));
  std::vector<std::string> outputs{request_.output, request_.depfile};
  for (const std::string& picture : pictures) outputs.push_back(stem + picture);
  for (size_t i = 0; file_extension(request_.output) == "gltf"; ++i) {
    const std::string bin = stem + "." + std::to_string(i) + ".bin";
    if (!fs::exists(bin, status)) break;
    outputs.push_back(bin);
  }
  for (const std::string& output : outputs)
    if (auto ok = check_replaces_no_input(output); !ok) return ok;
  const std::string folder = checkpoint_folder(request_);
  if (folder.empty()) return {};
  auto read = hashed(inputs());
  if (!read) return read.error();
  const json mine{{"format", 1},
                  {"build", build_name()},
                  {"request", to_json(request_)},
                  {"inputs", std::move(*read)},
                  {"output", fs::absolute(request_.output).lexically_normal().string()}};
  CheckpointOptions options;
  options.folder = folder, options.identity = dump(mine), options.warn = given_.warn;
  options.check = [mine, folder](std::span<const uint8_t> bytes) -> Result<void> {
    const std::string why = difference(read_identity(bytes), mine);
    if (why.empty()) return {};
    return Error{folder, why + "; `lambent checkpoints " + folder + " --clean` removes it"};
  };
  Ranks& ranks = this_ranks();
  const bool at_once = ranks.from_first(!request_.checkpoint.empty() || fs::exists(folder, status));
  options.after = at_once ? 0 : long_work;
  options.rank = ranks.rank();
  if (ranks.rank() > 0) options.warn = [&ranks](const std::string& line) { ranks.say(line); };
  checkpoint_ = std::make_unique<Checkpoint>(std::move(options));
  own_.progress->checkpoint = checkpoint_.get();
  if (!at_once) return {};
  // The first rank takes the folder; the others find it taken.
  Result<void> ok = ranks.rank() == 0 ? checkpoint_->begin() : Result<void>();
  if (!ranks.all(bool(ok))) return ok ? Error{folder, "is not to be had"} : ok;
  if (ranks.rank() > 0) (void)checkpoint_->begin();
  (void)ranks.all(true);  // all have looked at what is there before any adds to it
  return {};
}

size_t DurableBake::taken() const { return size_t(this_ranks().sum(checkpoint_ ? checkpoint_->taken() : 0)); }

Error DurableBake::explained(Error error) const {
  if (error.message == "cancelled" && checkpoint_ && checkpoint_->began())
    error.message += "; the same command goes on from " + checkpoint_folder(request_);
  else if (checkpoint_ && checkpoint_->began())
    error.message += "; what was baked is kept: --checkpoint " + checkpoint_folder(request_) + " goes on with it";
  return error;
}

void DurableBake::finish() {
  if (checkpoint_) checkpoint_->remove();
}

std::string depfile_text(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
  auto escaped = [](const std::string& path) {
    std::string out;
    for (char c : path) {
      if (c == ' ' || c == '#' || c == ':' || c == '\\') out += '\\';
      if (c == '$') out += '$';
      out += c;
    }
    return out;
  };
  std::string out;
  for (const std::string& output : outputs) out += (out.empty() ? "" : " ") + escaped(output);
  out += ':';
  for (const std::string& input : inputs) out += " \\\n  " + escaped(input);
  return out + "\n";
}

std::vector<std::string> files_of_depfile(const std::string& text) {
  std::vector<std::string> words(1);
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\n';
    if (c == '\\' && next == '\n') ++i;
    else if (c == '\\' || (c == '$' && next == '$')) words.back() += text[++i < text.size() ? i : i - 1];
    else if (c == ' ' || c == '\n') words.emplace_back();
    else if (c == ':' && (next == ' ' || next == '\n')) words.assign(1, "");  // what came before were outputs
    else words.back() += c;
  }
  std::erase(words, "");
  return words;
}

namespace {

void look_at(const fs::path& folder, std::vector<CheckpointFound>& out) {
  auto bytes = read_file((folder / checkpoint_identity_file).string());
  if (!bytes) return;
  const json identity = read_identity(*bytes);
  CheckpointFound found{.folder = folder.string()};
  std::error_code status;
  fs::file_time_type last = fs::file_time_type::min();
  for (const auto& entry : fs::directory_iterator(folder, status))
    if (entry.is_regular_file(status))
      found.bytes += entry.file_size(status), last = std::max(last, entry.last_write_time(status));
  found.age = std::chrono::duration<double>(fs::file_time_type::clock::now() - last).count();
  found.in_use = is_checkpoint_in_use(found.folder);
  if (!identity.is_object() || !identity.contains("format")) {
    found.stale = "its checkpoint.json is not readable";
  } else {
    auto text = [](const json& object, const char* key) {
      const json value = object.is_object() ? object.value(key, json()) : json();
      return value.is_string() ? value.get<std::string>() : std::string();
    };
    found.output = text(identity, "output"), found.scene = text(identity.value("request", json()), "scene");
    for (const json& input : identity.value("inputs", json::array())) {
      auto file = MappedFile::open(text(input, "path"));
      if (!file) found.stale = text(input, "path") + " is gone";
      else if (content_hash(file->bytes()) != text(input, "xxh3_128"))
        found.stale = text(input, "path") + " has changed";
    }
    if (text(identity, "build") != build_name()) found.stale = "another build of lambent, or another kind of processor";
  }
  out.push_back(std::move(found));
}

}  // namespace

std::vector<CheckpointFound> find_checkpoints(const std::string& folder) {
  std::vector<CheckpointFound> out;
  std::error_code status;
  look_at(folder, out);
  std::vector<fs::path> below;
  const auto options = fs::directory_options::skip_permission_denied;
  for (auto entry = fs::recursive_directory_iterator(folder, options, status);
       !status && entry != fs::recursive_directory_iterator(); entry.increment(status))
    if (entry->is_directory(status) && !entry->is_symlink(status)) below.push_back(entry->path());
  std::sort(below.begin(), below.end());
  for (const fs::path& path : below) look_at(path, out);
  return out;
}

}  // namespace lambent
