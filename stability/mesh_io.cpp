#include "stability/mesh_io.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <utility>

#include "stability/files.h"
#include "stability/mesh_holes.h"
#include "stability/mesh_import.h"
#include "stability/mesh_topology.h"

namespace dofusion {

namespace {

constexpr double kMostFileBytes = 2147483648.0;
constexpr double kFarthest = 1e4;  // sizes from the origin; there a float still tells 1/2000 of the size
constexpr double kSmallestObject = 1e-3, kLargestObject = 10.0;  // metres

std::string text_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string text_of(const Eigen::Vector3d& p) {
  return "(" + text_of(p.x()) + ", " + text_of(p.y()) + ", " + text_of(p.z()) + ")";
}

// "the edge between … and …, the first of 12," in the file's coordinates.
std::string place_of(const EdgeFault& fault, double unit) {
  return "the edge between " + text_of(fault.from / unit) + " and " + text_of(fault.to / unit) +
         (fault.count > 1 ? ", the first of " + std::to_string(fault.count) + "," : "");
}

void check_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such mesh file");
  const auto bytes = static_cast<double>(std::filesystem::file_size(path, error));
  if (bytes > kMostFileBytes) {
    throw InputError(path + ": a mesh file of " + text_of(bytes / 1e9) + " GB; simplify the mesh to " +
                     std::to_string(kMostFileTriangles) + " triangles or fewer");
  }
}

// In metres; throws at the first corner that is not finite.
TriangleMesh to_metres(const ImportedMesh& file, double unit, const std::string& path) {
  TriangleMesh mesh;
  for (const auto& v : file.vertices) mesh.vertices.push_back(unit * Eigen::Vector3d(v[0], v[1], v[2]));
  for (const auto& corners : file.triangles) {
    for (const std::uint32_t corner : corners) {
      if (mesh.vertices[corner].allFinite()) continue;
      throw InputError(path + ": triangle " + std::to_string(mesh.triangles.size() + 1) + " has a corner at " +
                       text_of(mesh.vertices[corner] / unit) +
                       ", which is not finite in single precision; export the mesh again");
    }
    mesh.triangles.emplace_back(static_cast<int>(corners[0]), static_cast<int>(corners[1]),
                                static_cast<int>(corners[2]));
  }
  return mesh;
}

[[noreturn]] void refuse_open(const EdgeFault& open, const std::string& extent, double unit, const std::string& path) {
  throw InputError(path + ": the mesh is open" + extent + ": " + place_of(open, unit) +
                   " belongs to one triangle only; close its holes (or merge vertices that nearly coincide)");
}

void refuse_walls(const SurfaceFaults& faults, double unit, const std::string& path) {
  if (faults.odd.count > 0) {
    throw InputError(path + ": the mesh has an inner wall: " + place_of(faults.odd, unit) + " is shared by " +
                     std::to_string(faults.odd.triangles) + " triangles; remove what lies inside the solid");
  }
}

ConsistentWinding consistently_wound(const TriangleMesh& mesh, const std::string& path) {
  std::optional<ConsistentWinding> wound = wound_consistently(mesh);
  if (!wound) throw InputError(path + ": the surface has one side only, as a Moebius strip; it bounds no solid");
  return std::move(*wound);
}

TriangleMesh wound_outwards(const TriangleMesh& mesh, double unit, const std::string& path) {
  const ConsistentWinding wound = consistently_wound(mesh, path);
  const SurfaceFaults faults = surface_faults(wound.mesh);
  if (faults.unbalanced.count > 0) {
    throw InputError(path + ": the mesh crosses itself: " + place_of(faults.unbalanced, unit) + " is shared by " +
                     std::to_string(faults.unbalanced.triangles) +
                     " triangles that cannot all face outwards; separate the solids that meet there");
  }
  try {
    return with_outward_shells(wound);
  } catch (const std::invalid_argument& e) {
    throw InputError(path + ": " + e.what());
  }
}

void refuse_without_volume(const TriangleMesh& mesh, const std::string& path) {
  const BoundingBox box = bounding_box(mesh);
  const double size = (box.max - box.min).norm();
  const double distance = ((box.max + box.min) / 2.0).norm();
  if (distance > kFarthest * size) {
    throw InputError(path + ": the mesh lies " + text_of(distance / size) +
                     " times its size from the origin, too far for its digits; move it to the origin");
  }
  if (!(std::abs(volume(translated(mesh, -box.min))) > 1e-9 * std::pow(size, 3))) {
    throw InputError(path + ": the mesh encloses no volume; is it flat, or is every face there in both directions?");
  }
}

// Of a mesh without holes.
TriangleMesh solid_of(const TriangleMesh& mesh, const SurfaceFaults& faults, double unit, const std::string& path) {
  refuse_walls(faults, unit, path);
  TriangleMesh solid = wound_outwards(mesh, unit, path);
  refuse_without_volume(solid, path);
  return solid;
}

}  // namespace

TriangleMesh read_mesh(const std::string& path, double unit, std::size_t most_triangles) {
  check_file(path);
  const TriangleMesh mesh = weld(to_metres(import_mesh(path, most_triangles), unit, path));
  if (mesh.triangles.empty()) throw InputError(path + ": the mesh has no triangles");
  return mesh;
}

TriangleMesh read_solid_mesh(const std::string& path, double unit) {
  const TriangleMesh mesh = without_repeated_triangles(read_mesh(path, unit));
  const SurfaceFaults faults = surface_faults(mesh);
  if (faults.open.count > 0) refuse_open(faults.open, "", unit, path);
  return solid_of(mesh, faults, unit, path);
}

MendedMesh read_mended_mesh(const std::string& path, double unit, std::size_t most_triangles) {
  const TriangleMesh mesh = without_repeated_triangles(read_mesh(path, unit, most_triangles));
  const SurfaceFaults faults = surface_faults(mesh);
  MendedMesh mended;
  if (faults.open.count == 0) {
    mended.mesh = solid_of(mesh, faults, unit, path);
    return mended;
  }
  refuse_walls(faults, unit, path);
  const FilledMesh filled = fill_holes(consistently_wound(mesh, path).mesh);
  if (filled.area_share > kMostOpenShare) {
    refuse_open(faults.open,
                " (filling its holes would make " + text_of(std::round(1000.0 * filled.area_share) / 10.0) +
                    " % of the surface, more than " + text_of(100.0 * kMostOpenShare) + " %)",
                unit, path);
  }
  mended.mesh = solid_of(filled.mesh, surface_faults(filled.mesh), unit, path);
  mended.holes = filled.holes;
  mended.open_edges = filled.open_edges;
  mended.filled_share = filled.area_share;
  return mended;
}

std::string mending_note(const std::string& path, const MendedMesh& mended) {
  if (mended.holes == 0) return "";
  char share[32];
  std::snprintf(share, sizeof share, "%.2g %%", 100.0 * mended.filled_share);
  return path + ": " + std::to_string(mended.holes) + (mended.holes == 1 ? " hole (" : " holes (") +
         std::to_string(mended.open_edges) + " open edges) filled, " + share + " of the surface";
}

void check_object_size(const std::string& path, double object_diameter, double unit, const std::string& unit_option) {
  if (object_diameter >= kSmallestObject && object_diameter <= kLargestObject) return;
  std::string message = path + ": the object measures " + text_of(object_diameter) +
                        " m; give the unit of its coordinates with " + unit_option;
  for (const double other : {1.0, 0.001, 0.01}) {  // metres, millimetres, centimetres
    const double size = object_diameter / unit * other;
    if (size < 0.005 || size > 3.0) continue;
    throw InputError(message + ": " + text_of(other) + " would make it " + text_of(size) + " m");
  }
  throw InputError(message);
}

std::string to_obj(const TriangleMesh& mesh) {
  std::string text;
  char line[128];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", v.x(), v.y(), v.z());
    text += line;
  }
  for (const Eigen::Vector3i& triangle : mesh.triangles) text += obj_face(triangle);
  return text;
}

std::string obj_face(const Eigen::Vector3i& triangle) {
  return "f " + std::to_string(triangle[0] + 1) + " " + std::to_string(triangle[1] + 1) + " " +
         std::to_string(triangle[2] + 1) + "\n";
}

void write_obj(const TriangleMesh& mesh, const std::string& path) { write_file(path, to_obj(mesh)); }

}  // namespace dofusion
