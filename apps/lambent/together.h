#pragma once
// Ranks (core/ranks.h) of MPI: the tool started several times over by mpirun or the like. Without MPI (LAMBENT_MPI in
// CMakeLists.txt) there is one process, and a launcher of several is refused.
#include <lambent/core/ranks.h>

#include <functional>
#include <memory>

namespace lambent::tool {

// As the launcher says, before anything is begun: how many, and which of them this is. One, where there is none.
struct Launched {
  int count = 1, rank = 0;
};
Launched launched();
bool has_ranks();  // by how the tool was built

// Between begin and end, the processes of one job.
class Together : public Ranks {
 public:
  // Null without MPI.
  static std::unique_ptr<Together> begin();
  // Ranks on this machine.
  virtual int local_count() const = 0;
  // The last call of each rank, with its exit code; the greatest of all. Those that failed wait for the others for a
  // moment, and then end the whole job, which would wait for them; `failed_alone` is called before.
  virtual int end(int code, const std::function<void()>& failed_alone) = 0;
};

}  // namespace lambent::tool
