#pragma once
#include "web.h"

#include <httplib.h>

namespace lambent::tool {

// Answers from one table of files and nothing else: a path is looked up, never opened. Only requests that name this
// machine are answered, so that a foreign page cannot have its own name point here and read them. One range of a file
// is answered as such, cut to the file's end; several are answered with the whole file; 416 where none of it is there.
// `files` and `port`, which may change until the server listens, must outlive the server.
void answer_from(httplib::Server& server, const WebFiles& files, const int& port);

}  // namespace lambent::tool
