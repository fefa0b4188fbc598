#include "tests/bench/bullet_peer.h"

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMassSpringForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btDeformableNeoHookeanForce.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>

#include "common/base/checksum.h"

namespace trocar::bench {
namespace {

// Constant nodal forces, and damping in proportion to each node's mass.
class LoadAndDrag : public btDeformableLagrangianForce {
 public:
  LoadAndDrag(const PulledBox& box, bool is_implicit)
      : forces_(box.forces_n),
        rate_(static_cast<btScalar>(box.material.node_damping_per_s)),
        is_implicit_(is_implicit) {}

  void addScaledForces(btScalar scale, TVStack& force) override {
    addScaledExplicitForce(scale, force);
    addScaledDampingForce(scale, force);
  }
  void addScaledExplicitForce(btScalar scale, TVStack& force) override {
    for_each_free([&](const btSoftBody::Node& node) {
      const Vec3f& f = forces_[static_cast<std::size_t>(node.index)];
      force[node.index] += btVector3(f.x, f.y, f.z) * scale;
      // An explicit step would solve for damping implicitly; so weak a one it need not.
      if (!is_implicit_) force[node.index] -= node.m_v * (scale * rate_ / node.m_im);
    });
  }
  void addScaledDampingForce(btScalar scale, TVStack& force) override {
    if (!is_implicit_) return;
    for_each_free([&](const btSoftBody::Node& node) {
      force[node.index] -= node.m_v * (scale * rate_ / node.m_im);
    });
  }
  void addScaledDampingForceDifferential(btScalar scale, const TVStack& dv, TVStack& df) override {
    if (!is_implicit_) return;
    for_each_free([&](const btSoftBody::Node& node) {
      df[node.index] -= dv[node.index] * (scale * rate_ / node.m_im);
    });
  }
  void addScaledElasticForceDifferential(btScalar, const TVStack&, TVStack&) override {}
  void buildDampingForceDifferentialDiagonal(btScalar, TVStack&) override {}
  double totalEnergy(btScalar) override { return 0; }
  // The library keeps one force per type, and has no type for others.
  btDeformableLagrangianForceType getForceType() override { return BT_COROTATED_FORCE; }

 private:
  template <typename F>
  void for_each_free(F&& f) {
    const auto& nodes = m_softBodies[0]->m_nodes;
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes[i].m_im > 0) f(nodes[i]);
  }

  std::span<const Vec3f> forces_;
  btScalar rate_;
  bool is_implicit_;
};

std::unique_ptr<btDeformableLagrangianForce> make_elastic_force(const PulledBox& box,
                                                                BulletLaw law) {
  const auto mu = static_cast<btScalar>(box.material.lame_mu_pa());
  const auto lambda = static_cast<btScalar>(box.material.lame_lambda_pa());
  switch (law) {
    case BulletLaw::Linear:
      return std::make_unique<btDeformableLinearElasticityForce>(mu, lambda, btScalar(0),
                                                                 btScalar(0));
    case BulletLaw::NeoHookean:
      return std::make_unique<btDeformableNeoHookeanForce>(
          mu * btScalar(4) / 3, lambda + mu * btScalar(5) / 6, btScalar(0));
    case BulletLaw::NeoHookeanAsGiven:
      return std::make_unique<btDeformableNeoHookeanForce>(mu, lambda, btScalar(0));
    case BulletLaw::MassSpring:
      break;
  }
  const auto springs = organ::springs_of(box.organ);
  double mean = 0;
  for (const auto& spring : springs)
    mean += spring.stiffness_n_m / static_cast<double>(springs.size());
  return std::make_unique<btDeformableMassSpringForce>(static_cast<btScalar>(mean), btScalar(0));
}

std::unique_ptr<btSoftBody> make_body(const PulledBox& box, BulletLaw law,
                                      btSoftBodyWorldInfo& info) {
  const auto& organ = box.organ;
  btAlignedObjectArray<btVector3> positions;
  btAlignedObjectArray<btScalar> masses;
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n) {
    const Vec3f p = to_float(organ.mesh.rest_positions[n]);
    positions.push_back({p.x, p.y, p.z});
    masses.push_back(static_cast<btScalar>(organ.node_masses_kg[n]));
  }
  auto body = std::make_unique<btSoftBody>(&info, positions.size(), &positions[0], &masses[0]);
  for (const auto node : organ.fixed_nodes) body->setMass(static_cast<int>(node.value), 0);
  const auto id = [](NodeIndex node) { return static_cast<int>(node.value); };
  if (law == BulletLaw::MassSpring) {
    for (const auto& pair : organ.mesh.spring_pairs()) body->appendLink(id(pair[0]), id(pair[1]));
  } else {
    for (const auto& tet : organ.mesh.tets)
      body->appendTetra(id(tet[0]), id(tet[1]), id(tet[2]), id(tet[3]));
    body->initializeDmInverse();
    body->m_tetraScratches.resize(body->m_tetras.size());
    body->m_tetraScratchesTn.resize(body->m_tetras.size());
  }
  body->setActivationState(DISABLE_DEACTIVATION);
  return body;
}

}  // namespace

struct BulletPeer::Body {
  Body(const PulledBox& pulled, BulletLaw law, bool is_implicit, double dt)
      : box(pulled), dt_s(static_cast<btScalar>(dt)), load(pulled, is_implicit) {
    const btVector3 no_gravity(0, 0, 0);
    solver.setDeformableSolver(&deformables);
    world.setGravity(no_gravity);
    world.getWorldInfo().m_gravity = no_gravity;
    world.getWorldInfo().air_density = 0;
    world.getWorldInfo().m_sparsesdf.Initialize();
    world.setImplicit(is_implicit);
    // Implicit steps without it were seen to leave the body where it is.
    world.setUseProjection(true);
    body = make_body(box, law, world.getWorldInfo());
    world.addSoftBody(body.get());
    elastic = make_elastic_force(box, law);
    world.addForce(body.get(), elastic.get());
    world.addForce(body.get(), &load);
  }
  ~Body() { world.removeSoftBody(body.get()); }

  const PulledBox& box;
  const btScalar dt_s;
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver deformables;
  btDeformableMultiBodyConstraintSolver solver;
  std::unique_ptr<btDeformableLagrangianForce> elastic;
  LoadAndDrag load;
  std::unique_ptr<btSoftBody> body;
  btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration,
                                           &deformables};
};

BulletPeer::BulletPeer(const PulledBox& box, BulletLaw law, bool is_implicit, double dt_s)
    : body_(std::make_unique<Body>(box, law, is_implicit, dt_s)) {}

BulletPeer::~BulletPeer() = default;

void BulletPeer::step() {
  // No substeps of the library's own: it would count time in float and now and then skip one.
  body_->world.stepSimulation(body_->dt_s, 0);
}

double BulletPeer::face_displacement() const {
  return body_->box.face_displacement([&](NodeIndex node) {
    return static_cast<double>(body_->body->m_nodes[static_cast<int>(node.value)].m_x.x()) -
           body_->box.organ.mesh.rest_positions[node.value].x;
  });
}

std::uint64_t BulletPeer::state_hash() const {
  StateHasher hasher;
  const auto& nodes = body_->body->m_nodes;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vec3f p{nodes[i].m_x.x(), nodes[i].m_x.y(), nodes[i].m_x.z()};
    hasher.update({reinterpret_cast<const std::uint8_t*>(&p), sizeof p});
  }
  return hasher.digest();
}

const char* BulletPeer::version() {
  static const std::string text =
      "Bullet " + std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
  return text.c_str();
}

}  // namespace trocar::bench
