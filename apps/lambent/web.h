#pragma once
// The web viewer as files: the built page, and beside it what it is to show. `view` serves them, `export` writes them.
#include <lambent/core/file.h>
#include <lambent/core/result.h>
#include <lambent/pipeline/bake.h>

#include <CLI/CLI.hpp>

#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace lambent::tool {

struct WebOptions {
  std::string baked, compare, reference;
  std::vector<std::string> env;
  std::vector<std::string> insert;  // objects put into the scene; each command adds the option
  std::string camera = "auto", rotate, exposure = "auto", tone = "neutral";
  std::string pack;  // auto, or the relative RMS error that transfer is rounded to; empty: files as they are
  void add_to(CLI::App& command);
};

struct WebFile {
  std::string type;  // media type
  std::variant<MappedFile, std::string> content;
  std::string_view bytes() const {
    if (const auto* text = std::get_if<std::string>(&content)) return *text;
    const auto mapped = std::get<MappedFile>(content).bytes();
    return {reinterpret_cast<const char*>(mapped.data()), mapped.size()};
  }
};

// By path relative to the page: index.html and what it needs; lambent.json, which says what to show; data/….
using WebFiles = std::map<std::string, WebFile>;

// Environments, files and skies alike, become .exr files of single floats, read as every other command reads them. The
// default is a sky. Objects are baked alone, each file once. Errors: the page is not built; anything wrong with a file
// or an option; cancelled.
Result<WebFiles> web_files(const WebOptions& options, const Job& job);

}  // namespace lambent::tool
