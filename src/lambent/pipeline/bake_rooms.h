#pragma once
// --rooms of a bake request.
#include <lambent/bake/rooms.h>
#include <lambent/pipeline/bake.h>

namespace lambent {

// The rooms that a request asks for: "auto", or a file {"rooms": [{"name": ..., "min": [x, y, z], "max": [x, y, z]} or
// {"name": ..., "nodes": [names]}, ...]}, boxes in the scene file's coordinates. Errors name the file and the room.
Result<std::vector<Room>> rooms_of_request(const BakeRequest& request, const Scene& scene);

// The scene's transfer by them; what it says of them goes to the summary and the provenance.
Result<Transfer> bake_rooms_of_request(const BakeRequest& request, const BakeOptions& options, const Scene& scene,
                                       const Receivers& receivers, const Job& job, BakeReport& report, Summary& summary,
                                       nlohmann::json& told);

}  // namespace lambent
