#pragma once
// What a bake that writes files does so that nothing is lost: it keeps its work in a checkpoint, and no output takes
// the place of an input.
#include <lambent/core/checkpoint.h>
#include <lambent/core/file.h>
#include <lambent/pipeline/bake_request.h>

#include <memory>
#include <string>
#include <vector>

namespace lambent {

class DurableBake {
 public:
  // `request` is resolved; it and `job` outlive this.
  DurableBake(const BakeRequest& request, const Job& job);
  ~DurableBake();
  // The job with what is kept of it.
  const Job& job() const { return own_; }
  // What a user is told of work that did not end.
  Error explained(Error error) const;
  // Pieces that an earlier run had kept, of all ranks.
  size_t taken() const;
  // All is written: the checkpoint goes.
  void finish();
  // The inputs read so far, each once.
  std::vector<std::string> inputs() const;

 private:
  Result<void> begin(const std::vector<std::string>& pictures);
  const BakeRequest& request_;
  const Job& given_;
  Job own_;
  Progress silent_;
  ReadLog log_;
  std::unique_ptr<Checkpoint> checkpoint_;
};

// Where the request's checkpoint is; "": it has none.
std::string checkpoint_folder(const BakeRequest& request);

// A rule of make: the outputs depend on the inputs.
std::string depfile_text(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs);

// The inputs of one.
std::vector<std::string> files_of_depfile(const std::string& text);

// A checkpoint found on the disk.
struct CheckpointFound {
  std::string folder, scene, output;
  size_t bytes = 0;
  double age = 0;  // seconds since something was kept
  bool in_use = false;
  std::string stale;  // why it cannot be gone on with; "": it can
};
// Those in a folder and in the folders below it, and the folder itself where it is one.
std::vector<CheckpointFound> find_checkpoints(const std::string& folder);

}  // namespace lambent
