#include "stability/mjcf.h"

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <sstream>

#include "stability/convex_hull.h"
#include "stability/convex_parts.h"
#include "stability/files.h"
#include "stability/mesh_io.h"

namespace dofusion {
namespace {

std::ostream& operator<<(std::ostream& out, const Eigen::Vector3d& v) {
  return out << v.x() << ' ' << v.y() << ' ' << v.z();
}

// Objects and scenes may carry names from files: keep what is safe inside an XML attribute.
std::string xml_safe(std::string text) {
  for (char& c : text) {
    if (c == '<' || c == '>' || c == '&' || c == '"' || c == '\'' || static_cast<unsigned char>(c) < 32) c = '_';
  }
  return text;
}

// MuJoCo gives a mesh at most three contacts with a plane, and a prism that lies on a rectangle rocks about the
// diagonal. So the corners of a mesh's hull carry the contact with the table, as massless spheres far smaller than any
// tolerance; the mesh itself meets other objects only. Meshes with very many corners keep MuJoCo's own contact.
constexpr double kCornerRadius = 1e-5;
constexpr std::size_t kMostCorners = 128;

// What stands for one object in the model.
struct Body {
  const Object& object;
  std::vector<TriangleMesh> solids;      // convex: what others touch; empty for primitives
  std::vector<Eigen::Vector3d> corners;  // what the table touches; empty if the solids touch it themselves
  std::string file;                      // of the mesh; empty: everything stands in the text
};

Body make_body(const Object& object, const std::string& file) {
  Body body{object, {}, {}, file};
  if (object.kind != SolidKind::kMesh) return body;
  body.solids = object.parts;
  if (body.solids.empty()) body.solids = object.convex ? std::vector<TriangleMesh>{object.mesh} : convex_parts(object.mesh);
  body.corners = object.convex ? object.mesh.vertices : convex_hull(object.mesh.vertices).vertices;
  if (body.corners.size() > kMostCorners) body.corners.clear();
  return body;
}

bool is_round(const Object& object) {
  return object.kind == SolidKind::kCylinder || object.kind == SolidKind::kSphere;
}

// A mesh that the file shows but nothing touches, where convex parts stand for it.
bool is_shown_apart(const Body& body) { return !body.file.empty() && !body.object.convex; }

std::string solid_name(std::size_t index, std::size_t part) {
  return "mesh_" + std::to_string(index) + (part == 0 ? "" : "_" + std::to_string(part));
}

void write_mesh_file(std::ostream& out, const std::string& name, const std::string& file) {
  out << "    <mesh name=\"" << name << "\" file=\"" << xml_safe(file) << "\"/>\n";
}

void write_mesh(std::ostream& out, const std::string& name, const TriangleMesh& mesh) {
  out << "    <mesh name=\"" << name << "\" vertex=\"";
  for (const Eigen::Vector3d& v : mesh.vertices) out << v << ' ';
  out << "\" face=\"";
  for (const Eigen::Vector3i& t : mesh.triangles) out << t[0] << ' ' << t[1] << ' ' << t[2] << ' ';
  out << "\"/>\n";
}

void write_assets(std::ostream& out, const Body& body, std::size_t index) {
  if (is_shown_apart(body)) write_mesh_file(out, "shown_" + std::to_string(index), body.file);
  for (std::size_t part = 0; part < body.solids.size(); ++part) {
    const std::string name = solid_name(index, part);
    if (!body.file.empty() && body.object.convex) {
      write_mesh_file(out, name, body.file);
    } else {
      write_mesh(out, name, body.solids[part]);
    }
  }
}

const char* colour(std::size_t index) {
  static const char* const colours[] = {"0.35 0.55 0.80 1", "0.90 0.60 0.25 1", "0.45 0.70 0.40 1",
                                        "0.80 0.40 0.40 1", "0.60 0.50 0.75 1", "0.60 0.45 0.35 1"};
  return colours[index % 6];
}

// The exact mass and inertia of the uniform solid, whatever stands for its surface.
void write_inertia(std::ostream& out, const Object& object, double density) {
  const Eigen::Matrix3d I = density * object.inertia;
  out << "      <inertial pos=\"0 0 0\" mass=\"" << density * object.volume << "\" fullinertia=\"" << I(0, 0) << ' '
      << I(1, 1) << ' ' << I(2, 2) << ' ' << I(0, 1) << ' ' << I(0, 2) << ' ' << I(1, 2) << "\"/>\n";
}

void write_primitive(std::ostream& out, const Object& object) {
  const BoundingBox box = bounding_box(object.mesh);
  const Eigen::Vector3d half = (box.max - box.min) / 2.0;
  switch (object.kind) {
    case SolidKind::kBox: out << "type=\"box\" size=\"" << half << "\""; break;
    case SolidKind::kCylinder: out << "type=\"cylinder\" size=\"" << half.x() << ' ' << half.z() << "\""; break;
    case SolidKind::kSphere: out << "type=\"sphere\" size=\"" << half.x() << "\""; break;
    case SolidKind::kMesh: break;
  }
}

void write_geoms(std::ostream& out, const Body& body, std::size_t index) {
  const std::string look = std::string(" rgba=\"") + colour(index) + "\"/>\n";
  if (body.object.kind != SolidKind::kMesh) {
    out << "      <geom class=\"" << (is_round(body.object) ? "round" : "solid") << "\" name=\"geom_" << index << "\" ";
    write_primitive(out, body.object);
    out << look;
    return;
  }
  if (is_shown_apart(body)) {
    out << "      <geom class=\"shown\" type=\"mesh\" mesh=\"shown_" << index << "\"" << look;
  }
  for (std::size_t part = 0; part < body.solids.size(); ++part) {
    out << "      <geom class=\"" << (body.corners.empty() ? "solid" : "above") << "\" name=\"geom_" << index
        << (part == 0 ? "" : "_" + std::to_string(part)) << "\" type=\"mesh\" mesh=\"" << solid_name(index, part) << "\"";
    if (is_shown_apart(body)) out << " group=\"3\"";
    out << look;
  }
  for (const Eigen::Vector3d& corner : body.corners) {
    out << "      <geom class=\"corner\" pos=\"" << corner << "\"/>\n";
  }
}

void write_body(std::ostream& out, const Body& body, std::size_t index, const Pose& T_world_object, bool fixed,
                double density) {
  const PoseArray pose = to_array(T_world_object);
  out << "    <body name=\"object_" << index << "\" pos=\"" << pose[0] << ' ' << pose[1] << ' ' << pose[2]
      << "\" quat=\"" << pose[3] << ' ' << pose[4] << ' ' << pose[5] << ' ' << pose[6] << "\""
      << (fixed ? " mocap=\"true\">\n" : ">\n      <freejoint/>\n");
  write_inertia(out, body.object, density);
  write_geoms(out, body, index);
  out << "    </body>\n";
}

// Room for contacts: eight for each pair of convex solids that may well meet, and every corner on the table; but no
// more than a heap of objects ever has, for MuJoCo keeps a square matrix of them.
std::size_t contact_room(const std::vector<Body>& bodies) {
  constexpr std::size_t kPerPair = 8, kMostPairs = 8;  // of solids of the same two objects, or of an object and the table
  std::size_t contacts = kPerPair;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const auto solids = [&](std::size_t k) { return std::max<std::size_t>(1, bodies[k].solids.size()); };
    contacts += bodies[i].corners.empty() ? kPerPair * std::min(kMostPairs, solids(i)) : bodies[i].corners.size();
    for (std::size_t j = 0; j < i; ++j) contacts += kPerPair * std::min(kMostPairs, std::max(solids(i), solids(j)));
  }
  return std::min(contacts, 24 * (1 + bodies.size()));
}

void write_settings(std::ostream& out, const std::vector<Body>& bodies, const PhysicsOptions& options) {
  const std::size_t contacts = contact_room(bodies);
  out << "  <compiler angle=\"radian\" balanceinertia=\"true\"/>\n"
      // Elliptic cones and a high impratio keep friction from creeping.
      << "  <option timestep=\"" << options.timestep << "\" cone=\"elliptic\" impratio=\"300\">\n"
      // A face must rest on more than one point.
      << "    <flag multiccd=\"enable\"/>\n"
      << "  </option>\n"
      << "  <size nconmax=\"" << contacts << "\" njmax=\"" << 4 * contacts << "\" nstack=\""
      << 100000 * (1 + bodies.size()) << "\"/>\n"
      << "  <default>\n"
      << "    <geom friction=\"" << options.friction << " 0.005 0.0001\" condim=\"4\" solref=\"" << options.contact_time
      << " 1\" solimp=\"0.99 0.99 0.0005\"/>\n"
      // Bit 1: objects among themselves; bit 2: the table, which meets solids or the corners of those above it.
      << "    <default class=\"solid\"><geom contype=\"1\" conaffinity=\"3\"/></default>\n"
      << "    <default class=\"round\"><geom contype=\"1\" conaffinity=\"3\" condim=\"6\" friction=\"" << options.friction
      << " 0.005 " << options.rolling_friction << "\"/></default>\n"
      << "    <default class=\"above\"><geom contype=\"1\" conaffinity=\"1\"/></default>\n"
      << "    <default class=\"corner\"><geom type=\"sphere\" size=\"" << kCornerRadius
      << "\" contype=\"0\" conaffinity=\"2\" group=\"3\"/></default>\n"
      << "    <default class=\"shown\"><geom contype=\"0\" conaffinity=\"0\" group=\"1\"/></default>\n"
      << "  </default>\n";
}

}  // namespace

std::string mjcf_text(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses,
                      const PhysicsOptions& options, const MjcfOptions& mjcf) {
  std::vector<Body> bodies;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    bodies.push_back(make_body(*objects[i], mjcf.mesh_files.empty() ? std::string() : mjcf.mesh_files[i]));
  }
  std::ostringstream out;
  out << std::setprecision(9);
  out << "<mujoco model=\"dofusion\">\n";
  write_settings(out, bodies, options);
  out << "  <visual><global offwidth=\"1280\" offheight=\"960\"/></visual>\n"
      << "  <asset>\n";
  for (std::size_t i = 0; i < bodies.size(); ++i) write_assets(out, bodies[i], i);
  out << "  </asset>\n"
      << "  <worldbody>\n"
      << "    <light pos=\"0.5 -0.5 1.5\" dir=\"-0.3 0.3 -1\" diffuse=\"0.7 0.7 0.7\"/>\n"
      << "    <geom name=\"table\" type=\"plane\" size=\"0 0 0.05\" contype=\"2\" conaffinity=\"0\" rgba=\"0.8 0.8 0.8 1\"/>\n";
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const bool fixed = !mjcf.fixed.empty() && mjcf.fixed[i];
    write_body(out, bodies[i], i, poses.empty() ? Pose::Identity() : poses[i], fixed, options.density);
  }
  out << "  </worldbody>\n"
      << "</mujoco>\n";
  return out.str();
}

void write_mjcf(const Scene& scene, const std::string& directory, const PhysicsOptions& options) {
  OutputDirectory output(directory);
  std::filesystem::create_directory(output.path() / "objects");
  MjcfOptions mjcf;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    mjcf.mesh_files.push_back("objects/" + std::to_string(i) + ".obj");
    write_obj(scene.objects[i]->mesh, (output.path() / mjcf.mesh_files.back()).string());
  }
  write_file(output.path() / "scene.xml", mjcf_text(scene.objects, scene.T_world_object, options, mjcf));
  output.commit();
}

}  // namespace dofusion
