// Repairs MuJoCo 2.2's collision of two boxes. Private to stability.
#pragma once

namespace dofusion {

// Replaces MuJoCo's box-box collision function in this process by one that corrects its results (2.2.2):
//   - where faces meet it also reports corners that lie beside the other box, centimetres away, which hold up boxes
//     that hang over an edge; with parallel edges just touching it reports depths of half a metre. Contacts outside
//     either box are dropped, and if none is left MuJoCo's general convex collision decides;
//   - where a face is touched it says half the depth (2.5 mm for boxes that overlap by 5 mm). It is doubled.
// May be called again, from any thread.
void repair_box_collision();

}  // namespace dofusion
