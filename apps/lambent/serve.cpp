#include "serve.h"

namespace lambent::tool {
namespace {

WebFiles::const_iterator find(const WebFiles& files, const httplib::Request& request) {
  return files.find(request.path == "/" ? "index.html" : request.path.empty() ? "" : request.path.substr(1));
}

// RFC 9110, section 14: brings the ranges asked for into the file; false where it holds nothing of them. The library
// leaves them as they are, and would answer beyond the end of what it was given.
bool fit_ranges(httplib::Ranges& ranges, size_t file_size) {
  const auto size = ssize_t(file_size);
  if (ranges.size() != 1) return ranges.clear(), true;
  auto& [first, last] = ranges.front();
  const bool means_nothing = (first < 0 && last < 0) || (first >= 0 && last >= 0 && last < first);
  if (means_nothing) return ranges.clear(), true;
  if (first < 0) first = std::max<ssize_t>(0, size - last), last = size - 1;  // the last so many bytes
  else if (last < 0 || last >= size) last = size - 1;
  return first < size;
}

}  // namespace

void answer_from(httplib::Server& server, const WebFiles& files, const int& port) {
  server.set_pre_routing_handler([&files, &port](const httplib::Request& request, httplib::Response& response) {
    const auto refuse = [&](int status, const char* message) {
      const_cast<httplib::Request&>(request).ranges.clear();  // of the message, otherwise
      response.status = status;
      response.set_content(message, "text/plain");
      return httplib::Server::HandlerResponse::Handled;
    };
    const std::string host = request.get_header_value("Host"), tail = ":" + std::to_string(port);
    if (host != "127.0.0.1" + tail && host != "localhost" + tail)
      return refuse(403, "This server answers its own machine only.\n");
    const auto file = find(files, request);
    if (file == files.end()) return refuse(404, "There is no such file.\n");
    // The request is the library's own and not constant; it reads its ranges again when it answers.
    const size_t size = file->second.bytes().size();
    if (!fit_ranges(const_cast<httplib::Request&>(request).ranges, size)) {
      response.set_header("Content-Range", "bytes */" + std::to_string(size));
      return refuse(416, "The file does not reach so far.\n");
    }
    return httplib::Server::HandlerResponse::Unhandled;
  });
  server.Get(".*", [&files](const httplib::Request& request, httplib::Response& response) {
    const auto file = find(files, request);
    const std::string_view bytes = file->second.bytes();
    if (bytes.empty()) return response.set_content("", file->second.type);  // the library waits for a piece of it
    response.set_content_provider(
        bytes.size(), file->second.type, [bytes](size_t offset, size_t length, httplib::DataSink& sink) {
          if (offset > bytes.size()) return false;
          const std::string_view piece = bytes.substr(offset, std::min<size_t>(length, 1 << 16));
          return sink.write(piece.data(), piece.size());
        });
  });
  server.set_default_headers({{"X-Content-Type-Options", "nosniff"},
                              {"Cache-Control", "no-store"},
                              {"Cross-Origin-Resource-Policy", "same-origin"}});
  server.set_payload_max_length(0);
  // The library's default lets two programs share a port, and each would get half of the other's requests.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
}

}  // namespace lambent::tool
