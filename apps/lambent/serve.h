#pragma once
#include "web.h"

#include <functional>

namespace lambent::tool {

// What a sender may take; more ends its connection, and nobody else's.
struct ServeLimits {
  size_t head_bytes = 16384;  // of a request with its headers
  size_t headers = 100;       // of a request
  double seconds = 10;        // from one answer, or from the start, to the end of the next request's head
  double stalled = 60;        // in which nothing of an answer was taken
  size_t connections = 1000;  // at a time; beyond, the one that did nothing for longest is closed
};

// A socket on 127.0.0.1 that listens.
struct Listener {
  int socket = -1, port = 0;
  Listener(int s, int p) : socket(s), port(p) {}
  Listener(Listener&& other) noexcept : socket(std::exchange(other.socket, -1)), port(other.port) {}
  Listener& operator=(Listener&&) = delete;
  ~Listener();
};
// Port 0: any that is free. Errors: the port is taken or not allowed.
Result<Listener> listen_on(int port);

// Answers GET and HEAD over HTTP/1.1 from one table of files and nothing else, until `stop` says true: a path is looked
// up, never opened. Only requests that name this machine are answered, so that a foreign page cannot have its own name
// point here and read them. One range of a file is answered as such, cut to the file's end; several are answered with
// the whole file; 416 where none of it is there (RFC 9110, section 14). One thread waits for all connections at once,
// so that none waits for another; what each keeps is its request's head.
void serve(const Listener& listener, const WebFiles& files, const std::function<bool()>& stop,
           const ServeLimits& limits = {});

}  // namespace lambent::tool
