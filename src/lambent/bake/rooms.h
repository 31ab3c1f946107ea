#pragma once
// A scene's diffuse transfer room by room. A room's rows are gathered among its own triangles; a ray that leaves its
// box into another ends at a NODE of that opening's light field: a cell of place and direction, whose value is the
// light that arrives along rays of that cell, gathered in the room beyond. So the operator over all receivers and nodes
// is blocks of rooms, joined through nodes alone, and is solved as such: inner iterations within a room, outer ones
// over rooms with the newest light of their openings. Source: radiosity, "Problem Size" (rooms coupled through 4D light
// fields, two-level block-structured iteration). Where a light field blurs more than it may, at cuts that nothing
// closes, there is none: rays are handed on into the room beyond, whose receivers they meet (room_rays.h).
#include <lambent/bake/bake.h>
#include <lambent/bake/room_boxes.h>

#include <string>
#include <vector>

namespace lambent {

struct RoomsOptions {
  double residual = 0.01;  // |e + A x - x| / |x| over all rooms, as they are met, at which it ends; > 0
  int most_sweeps = 100;   // over all rooms
  int places = 32;         // cells of place along an opening's longer side
  int directions = 16;     // and of direction along each side of the square that maps onto the half space
  // Of what receivers have, the most that light fields may lose (FieldLoss); 0: there are none, infinite: as they are.
  double loss = 0.01;
  // No light fields at all where their nodes would take more memory than rays that are handed on, or send more of them:
  // the search for nodes ends as soon as that is known.
  bool cheapest = false;
  // Of more ranks than one each has a part of the result alone, as the file is written (core/own_part.h): for whom does
  // nothing else with it.
  bool own_part = false;
  bool keep_sweeps = false;  // what all receivers have after each sweep, in the report
  std::string scratch;       // a folder for rows that memory has no room for; "": they are traced again
};

struct RoomsReport {
  size_t rooms = 0, openings = 0, nodes = 0, largest = 0;  // largest: receivers of a room
  std::vector<double> residuals;                           // of each sweep
  std::vector<Transfer> sweeps;                            // after each, where they are kept
  bool converged = false;
  size_t handed = 0, handed_rays = 0;  // openings whose rays are handed on, and rays that were
  double loss = 0;                     // what light fields lose, as measured
  double loss_of_all = -1;             // what they would at all openings; < 0: not measured, there being none
  double lost = 0;                     // share of the rays through openings that met no node, and count as dark
};

// All of the light, however often it is reflected. Of `options` order, samples, memory, seed and precision count.
// Errors: what bake() refuses; lobes, see-through surfaces, receivers that are not at vertices; cancelled.
Result<Transfer> bake_rooms(const Scene& scene, const Receivers& receivers, const std::vector<Room>& rooms,
                            const BakeOptions& options, const RoomsOptions& how, BakeReport* report = nullptr,
                            RoomsReport* rooms_report = nullptr, Progress* progress = nullptr);

}  // namespace lambent
