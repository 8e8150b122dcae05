// Contacts of boxes and convex meshes, in place of MuJoCo 2.2's own. Private to stability.
#pragma once

namespace dofusion {

// Replaces MuJoCo's collision functions for box-box, box-mesh and mesh-mesh in this process. MuJoCo still finds whether,
// how deep and in which direction two solids overlap; where a face takes part, the contacts are the corners of the
// overlap of the two faces, by clipping one against the other. MuJoCo's own (2.2.2) are not good enough to stand on:
//   - two meshes get five points from collisions of slightly turned copies, inside the overlap, with normals off by
//     0.06 degrees and depths off by as much as a block sinks in: blocks on blocks rock for ever by a tenth of a degree;
//   - two boxes also get corners that lie beside the other box, centimetres away, which hold up what hangs over an edge;
//     with parallel edges just touching, depths of half a metre; and half the depth wherever a face is touched.
// Edges across edges keep MuJoCo's single contact. May be called again, from any thread.
void use_face_contacts();

}  // namespace dofusion
