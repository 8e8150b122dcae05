#include "stability/face_contacts.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

using Eigen::Vector3d;

constexpr double kAlongFace = 0.9998;        // cosine between contact and face normal above which the face takes part
constexpr int kMostCorners = 72;             // of a face; solids with rounder ones keep MuJoCo's contacts
constexpr int kMostContacts = 8;             // of a pair; of more, those farthest from each other

mjfCollision original_box_box = nullptr, original_box_mesh = nullptr, original_mesh_mesh = nullptr;

// A convex polygon of at most kMostCorners corners, counter-clockwise seen from where `normal` points.
struct Face {
  Vector3d normal = Vector3d::Zero();
  std::array<Vector3d, kMostCorners> corners;
  int size = 0;

  bool add(const Vector3d& corner) {
    if (size == kMostCorners) return false;
    corners[static_cast<std::size_t>(size++)] = corner;
    return true;
  }
};

Eigen::Map<const Vector3d> position_of(const mjData& data, int geom) {
  return Eigen::Map<const Vector3d>(data.geom_xpos + 3 * geom);
}

Eigen::Matrix3d rotation_of(const mjData& data, int geom) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data.geom_xmat + 9 * geom);
}

// The face of a box, in its own frame, that looks most along `direction`.
bool box_face(const mjtNum* half, const Vector3d& direction, Face& face) {
  int axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  const double side = direction[axis] < 0.0 ? -1.0 : 1.0;
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  face.normal = side * Vector3d::Unit(axis);
  for (const auto& [a, b] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
    Vector3d corner;
    corner[axis] = side * half[axis];
    corner[u] = a * side * half[u];  // mirrored on the far side, so that the corners run the right way round there too
    corner[v] = b * half[v];
    face.add(corner);
  }
  return true;
}

// Sorts the corners of a convex polygon about their middle.
void sort_corners(Face& face) {
  Vector3d middle = Vector3d::Zero();
  for (int i = 0; i < face.size; ++i) middle += face.corners[i] / face.size;
  const Vector3d x = (face.corners[0] - middle).normalized(), y = face.normal.cross(x);
  std::array<double, kMostCorners> angle;
  for (int i = 0; i < face.size; ++i) {
    const Vector3d r = face.corners[i] - middle;
    angle[i] = std::atan2(r.dot(y), r.dot(x));
  }
  for (int i = 1; i < face.size; ++i) {
    for (int k = i; k > 0 && angle[k] < angle[k - 1]; --k) {
      std::swap(angle[k], angle[k - 1]);
      std::swap(face.corners[k], face.corners[k - 1]);
    }
  }
}

// The convex hull of a mesh, which is what MuJoCo collides, as it lies in the model.
struct Hull {
  const float* vertices;       // of the mesh
  const int* triangles;        // three of its vertices each
  const int* corners;          // of its vertices, those of the hull; null: all
  int triangle_count, corner_count;

  Vector3d vertex(int i) const { return Eigen::Map<const Eigen::Vector3f>(vertices + 3 * i).cast<double>(); }
  Vector3d corner(int i) const { return vertex(corners == nullptr ? i : corners[i]); }
  // Outward, as long as twice the triangle's area; the origin, the mesh's centre of mass, lies inside.
  Vector3d normal(int t) const {
    const Vector3d a = vertex(triangles[3 * t]);
    const Vector3d n = (vertex(triangles[3 * t + 1]) - a).cross(vertex(triangles[3 * t + 2]) - a);
    return n.dot(a) < 0.0 ? Vector3d(-n) : n;
  }
};

Hull hull_of(const mjModel& model, int mesh) {
  const float* vertices = model.mesh_vert + 3 * model.mesh_vertadr[mesh];
  if (model.mesh_graphadr[mesh] < 0) {
    return {vertices, model.mesh_face + 3 * model.mesh_faceadr[mesh], nullptr, model.mesh_facenum[mesh],
            model.mesh_vertnum[mesh]};
  }
  // Numbers of corners V and triangles T; V edge addresses, V corners, V + 3 T edges, 3 T triangle corners.
  const int* graph = model.mesh_graph + model.mesh_graphadr[mesh];
  const int V = graph[0], T = graph[1];
  return {vertices, graph + 2 + 3 * V + 3 * T, graph + 2 + V, T, V};
}

// The same of a mesh's hull: all corners in the plane of the triangle that looks most along `direction`.
bool mesh_face(const mjModel& model, int mesh, const Vector3d& direction, Face& face) {
  constexpr double kInPlane = 1e-5;  // of the distance from the middle to the plane, plus that much of a corner's
  constexpr double kAsGood = 1e-6;   // between cosines: the larger triangle decides, since slivers have noisy normals
  const Hull hull = hull_of(model, mesh);
  Vector3d best = Vector3d::Zero();
  double best_cosine = -2.0, offset = 0.0;
  for (int t = 0; t < hull.triangle_count; ++t) {
    const Vector3d n = hull.normal(t);
    const double length = n.norm(), cosine = n.dot(direction) / length;
    if (!(cosine > best_cosine - kAsGood)) continue;  // also where a triangle has no area
    if (cosine < best_cosine + kAsGood && length < best.norm()) continue;
    best_cosine = cosine;
    best = n;
    offset = n.dot(hull.vertex(hull.triangles[3 * t])) / length;
  }
  if (best_cosine < -1.0) return false;
  face.normal = best.normalized();
  for (int i = 0; i < hull.corner_count; ++i) {
    const Vector3d corner = hull.corner(i);
    if (face.normal.dot(corner) < offset - kInPlane * (offset + corner.norm())) continue;
    if (!face.add(corner)) return false;
  }
  if (face.size < 3) return false;
  sort_corners(face);
  return true;
}

// The face of a geom that looks most along `direction`, in the world. False if it has too many corners.
bool world_face(const mjModel& model, const mjData& data, int geom, const Vector3d& direction, Face& face) {
  const Eigen::Matrix3d R = rotation_of(data, geom);
  const Vector3d local = R.transpose() * direction;
  const bool found = model.geom_type[geom] == mjGEOM_BOX ? box_face(model.geom_size + 3 * geom, local, face)
                                                         : mesh_face(model, model.geom_dataid[geom], local, face);
  if (!found) return false;
  face.normal = R * face.normal;
  for (int i = 0; i < face.size; ++i) face.corners[i] = R * face.corners[i] + position_of(data, geom);
  return true;
}

// What of `polygon` lies within the prism over `reference` (Sutherland and Hodgman 1974). False if that has too many
// corners.
bool clip(const Face& reference, Face& polygon) {
  for (int i = 0; i < reference.size && polygon.size > 0; ++i) {
    const Vector3d& from = reference.corners[i];
    const Vector3d inward = reference.normal.cross(reference.corners[(i + 1) % reference.size] - from);
    Face kept;
    bool room = true;
    for (int k = 0; k < polygon.size; ++k) {
      const Vector3d &a = polygon.corners[k], &b = polygon.corners[(k + 1) % polygon.size];
      const double at_a = inward.dot(a - from), at_b = inward.dot(b - from);
      if (at_a >= 0.0) room = kept.add(a) && room;
      if ((at_a >= 0.0) != (at_b >= 0.0)) room = kept.add(a + at_a / (at_a - at_b) * (b - a)) && room;
    }
    if (!room) return false;
    kept.normal = polygon.normal;
    polygon = kept;
  }
  return true;
}

// Of too many contacts keeps kMostContacts: the deepest, then always the one farthest from those kept.
int thin_out(mjContact* contacts, int count) {
  if (count <= kMostContacts) return count;
  std::swap(contacts[0], *std::min_element(contacts, contacts + count,
                                           [](const mjContact& a, const mjContact& b) { return a.dist < b.dist; }));
  for (int kept = 1; kept < kMostContacts; ++kept) {
    const auto nearest = [&](const mjContact& c) {
      double distance = mju_dist3(c.pos, contacts[0].pos);
      for (int i = 1; i < kept; ++i) distance = std::min<double>(distance, mju_dist3(c.pos, contacts[i].pos));
      return distance;
    };
    std::swap(contacts[kept],
              *std::max_element(contacts + kept, contacts + count, [&](const mjContact& a, const mjContact& b) {
                return nearest(a) < nearest(b);
              }));
  }
  return kMostContacts;
}

// Writes the corners of the overlap of the two faces that meet, or returns 0 if none does: edges across each other.
int face_contacts(const mjModel& model, const mjData& data, mjContact* contacts, int geom1, int geom2, double margin) {
  const mjContact found = contacts[0];
  const Vector3d normal(found.frame[0], found.frame[1], found.frame[2]);  // from geom1 to geom2
  Face face1, face2;
  if (!world_face(model, data, geom1, normal, face1) || !world_face(model, data, geom2, -normal, face2)) return 0;
  const double along1 = face1.normal.dot(normal), along2 = -face2.normal.dot(normal);
  if (std::max(along1, along2) < kAlongFace) return 0;
  const bool first = along1 >= along2 - 1e-6;  // the first of two that are as good, so as not to change from step to step
  const Face& reference = first ? face1 : face2;
  Face& incident = first ? face2 : face1;
  if (!clip(reference, incident)) return 0;

  const Vector3d outward = first ? reference.normal : Vector3d(-reference.normal);
  std::array<mjContact, kMostCorners> all;
  int count = 0;
  for (int i = 0; i < incident.size; ++i) {
    const double distance = reference.normal.dot(incident.corners[i] - reference.corners[0]);
    if (distance > margin) continue;
    const Vector3d middle = incident.corners[i] - 0.5 * distance * reference.normal;
    mjContact& contact = all[static_cast<std::size_t>(count++)];
    contact = found;
    contact.dist = distance;
    mju_copy3(contact.pos, middle.data());
    mju_copy3(contact.frame, outward.data());
    mju_zero3(contact.frame + 3);  // MuJoCo completes the frame
  }
  count = thin_out(all.data(), count);
  std::copy_n(all.begin(), count, contacts);
  return count;
}

// MuJoCo's verdict by one collision, without the turned copies.
int single_collision(mjfCollision collide, const mjModel* model, const mjData* data, mjContact* contacts, int geom1,
                     int geom2, mjtNum margin) {
  // A model belongs to one simulation, which runs on one thread.
  int& flags = const_cast<mjModel*>(model)->opt.enableflags;
  const int before = flags;
  flags &= ~mjENBL_MULTICCD;
  const int found = collide(model, data, contacts, geom1, geom2, margin);
  flags = before;
  return found;
}

int convex_convex(mjfCollision collide, const mjModel* model, const mjData* data, mjContact* contacts, int geom1,
                  int geom2, mjtNum margin) {
  if (single_collision(collide, model, data, contacts, geom1, geom2, margin) == 0) return 0;
  const mjContact edge_contact = contacts[0];
  const int count = face_contacts(*model, *data, contacts, geom1, geom2, margin);
  if (count > 0) return count;
  contacts[0] = edge_contact;
  return 1;
}

int box_mesh(const mjModel* m, const mjData* d, mjContact* contacts, int g1, int g2, mjtNum margin) {
  return convex_convex(original_box_mesh, m, d, contacts, g1, g2, margin);
}

int mesh_mesh(const mjModel* m, const mjData* d, mjContact* contacts, int g1, int g2, mjtNum margin) {
  return convex_convex(original_mesh_mesh, m, d, contacts, g1, g2, margin);
}

int box_box(const mjModel* m, const mjData* d, mjContact* contacts, int g1, int g2, mjtNum margin) {
  // The box function is right about whether and in which direction two boxes touch, not about where; between edges it is
  // right about that too.
  return convex_convex(original_box_box, m, d, contacts, g1, g2, margin);
}

}  // namespace

void use_face_contacts() {
  static std::once_flag once;
  std::call_once(once, [] {
    original_box_box = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX];
    original_box_mesh = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_MESH];
    original_mesh_mesh = mjCOLLISIONFUNC[mjGEOM_MESH][mjGEOM_MESH];
    mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX] = box_box;
    mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_MESH] = box_mesh;
    mjCOLLISIONFUNC[mjGEOM_MESH][mjGEOM_MESH] = mesh_mesh;
  });
}

}  // namespace dofusion
