#pragma once
// Small scenes and pixel access for the tests of pictures.

#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "core/render/camera.h"
#include "core/render/render.h"
#include "tests/support/shapes.h"

namespace gridcast::render {

/// Builds a scene object by object, each with its own mesh and material.
class SceneMaker {
 public:
  SceneMaker& add(mesh::TriangleMesh mesh, const scene::Material& material, const Affine& place = {}) {
    mesh.parts = {{0, std::uint32_t(mesh.triangles.size()), std::uint32_t(data_.materials.size())}};
    scene::InstanceData instance;
    instance.mesh_id = std::uint32_t(data_.meshes.size());
    instance.world_from_object = place;
    data_.materials.push_back(material);
    data_.meshes.push_back(test::share(std::move(mesh)));
    data_.deformations.emplace_back();
    data_.instances.push_back(instance);
    return *this;
  }
  SceneMaker& light(const scene::Light& light) {
    data_.lights.push_back(light);
    return *this;
  }
  SceneMaker& camera(const scene::Camera& camera) {
    data_.cameras.push_back(camera);
    return *this;
  }
  [[nodiscard]] std::shared_ptr<const scene::Scene> build() const {
    auto scene = scene::build_scene(data_);
    EXPECT_TRUE(scene.ok());
    return *scene;
  }

 private:
  scene::SceneData data_;
};

inline scene::Material matt(float r, float g, float b) {
  scene::Material material;
  material.base_color = {r, g, b, 1.F};
  material.metallic = 0.F;
  return material;
}
inline scene::Material unlit(float r, float g, float b) {
  scene::Material material = matt(r, g, b);
  material.unlit = true;
  return material;
}
inline scene::Material mirror() {
  scene::Material material = matt(1.F, 1.F, 1.F);
  material.metallic = 1.F;
  material.roughness = 0.F;
  return material;
}
inline scene::Material glass(float ior = 1.5F) {
  scene::Material material = matt(1.F, 1.F, 1.F);
  material.roughness = 0.F;
  material.transmission = 1.F;
  material.ior = ior;
  return material;
}
inline scene::Light directional(const Vec3d& direction, double lux) {
  scene::Light light;
  light.direction = glm::normalize(direction);
  light.intensity = lux;
  return light;
}
inline Affine moved(const Vec3d& translation) {
  Affine place;
  place.translation = translation;
  return place;
}

/// Parallel rays along -z from z = distance; the picture spans [-half, half] in x and y.
inline RenderSettings from_front(double half, int side_px, double distance = 5.0) {
  RenderSettings settings;
  settings.camera.kind = scene::CameraKind::kOrthographic;
  settings.camera.xmag = settings.camera.ymag = half;
  settings.camera.world_from_camera.translation = {0.0, 0.0, distance};
  settings.width_px = settings.height_px = side_px;
  return settings;
}

/// One pixel that looks from `eye` straight at `target`.
inline RenderSettings one_ray(const Vec3d& eye, const Vec3d& target) {
  RenderSettings settings;
  settings.camera = look_at(eye, target, {0.01, 1.0, 0.02}, 0.5).value();
  settings.width_px = settings.height_px = 1;
  return settings;
}

inline Film rendered(const scene::Scene& scene, const RenderSettings& settings) {
  auto film = render(scene, settings);
  EXPECT_TRUE(film.ok());
  return std::move(film).value();
}

inline Vec3f color_at(const Film& film, int x = 0, int y = 0) {
  const float* rgba =
      &film.find("color")->values[4 * (std::size_t(y) * std::size_t(film.width_px) + std::size_t(x))];
  return {rgba[0], rgba[1], rgba[2]};
}
inline float alpha_at(const Film& film, std::size_t pixel) {
  return film.find("color")->values[4 * pixel + 3];
}

}  // namespace gridcast::render
