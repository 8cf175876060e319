#include "core/render/surface.h"

#include "core/scene/spawn.h"

namespace gridcast::render {
namespace {

// What a mesh without a material looks like: a light matt grey. (glTF's own default is rough metal, which
// shows shapes badly.)
const scene::Material& plain_material() {
  static const scene::Material material = [] {
    scene::Material plain;
    plain.base_color = {0.75F, 0.75F, 0.75F, 1.F};
    plain.metallic = 0.F;
    plain.roughness = 0.6F;
    return plain;
  }();
  return material;
}

const scene::Material& material_of(const scene::Scene& scene, const mesh::TriangleMesh& mesh,
                                   std::uint32_t primitive_id) {
  if (mesh.parts.empty()) return plain_material();
  const std::uint32_t id = mesh.parts[mesh.part_of(primitive_id)].material_id;
  const auto& materials = scene.data().materials;
  return id < materials.size() ? materials[id] : plain_material();
}

struct SmoothPatch {
  Vec3d positions[3];
  Vec3d normals[3];
  double weights[3];
};

// Where the three tangent planes at the corners, interpolated, pass above the triangle. Shadow rays that
// start there do not see the facets around them, which would draw the mesh's edges along every terminator.
// "Hacking the Shadow Terminator", J. Hanika, 2021.
Vec3d lift(const SmoothPatch& patch, const Vec3d& point) {
  Vec3d lifted = point;
  for (int i = 0; i < 3; ++i) {
    const double below = glm::dot(point - patch.positions[i], patch.normals[i]);
    if (below < 0.0) lifted -= patch.weights[i] * below * patch.normals[i];
  }
  return lifted;
}

void smooth(const scene::Scene& scene, const SurfaceHit& hit, Surface& surface) {
  const mesh::TriangleMesh& mesh = scene.blas(hit.mesh_id).mesh();
  if (mesh.normals.empty()) return;
  const InstanceTransform& transform = scene.instance(hit.instance_id).transform;
  const mesh::Triangle& corner = mesh.triangles[hit.primitive_id];
  SmoothPatch patch{{}, {}, {1.0 - hit.u - hit.v, hit.u, hit.v}};
  Vec3d normal(0.0);
  for (std::size_t i = 0; i < 3; ++i) {
    Vec3d n = transform.normal_to_world(Vec3d(mesh.normals[corner[i]]));
    if (!is_finite(n)) return;
    if (glm::dot(n, surface.geometric) < 0.0) n = -n;
    patch.positions[i] = transform.world_from_object().point(Vec3d(mesh.positions[corner[i]]));
    patch.normals[i] = n;
    normal += patch.weights[i] * n;
  }
  const double length = glm::length(normal);
  if (!(length > 1e-6)) return;
  surface.normal = normal / length;
  surface.smooth_point = lift(patch, surface.point);
}

// A normal that faces away from the viewer, as interpolated ones do near silhouettes, is turned until it is
// seen at a grazing angle.
Vec3d turned_to_viewer(const Vec3d& normal, const Vec3d& view) {
  constexpr double kGrazing = 0.02;
  const double cosine = glm::dot(normal, view);
  return cosine >= kGrazing ? normal : glm::normalize(normal + (kGrazing - cosine) * view);
}

}  // namespace

Surface make_surface(const scene::Scene& scene, const Ray& ray, const SurfaceHit& hit) {
  Surface surface;
  surface.hit = hit;
  surface.point = scene::SpawnPoint(scene, hit).position();
  surface.view = -glm::normalize(ray.direction);
  surface.side = glm::dot(hit.normal, ray.direction) <= 0.0 ? Side::kFront : Side::kBack;
  surface.geometric = surface.side == Side::kFront ? hit.normal : -hit.normal;
  surface.normal = surface.geometric;
  surface.smooth_point = surface.point;
  surface.material = &material_of(scene, scene.blas(hit.mesh_id).mesh(), hit.primitive_id);
  smooth(scene, hit, surface);
  surface.normal = turned_to_viewer(surface.normal, surface.view);
  return surface;
}

Vec3d spawn_origin(const scene::Scene& scene, const Surface& surface, const Vec3d& point, Leave leave) {
  const Vec3d& towards = surface.geometric;
  return scene::SpawnPoint(scene, surface.hit)
      .origin(point, leave == Leave::kTowardsViewer ? towards : -towards);
}

}  // namespace gridcast::render
