// Forces and tangents of the reduced models' tets against the off-line solver's and against
// differences.

#include "server/tissue/reduction/element_set.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "server/lab/reduce/full_model.h"
#include "tests/reduce/small_organ.h"

namespace trocar::reduce {
namespace {

struct Case {
  const char* name;
  void (*use)(material::Material&);
};
void measured(material::Material&) {}
void exponential(material::Material& material) {
  auto& law = material.measured;
  law.energy = material::StrainEnergy::Exponential;
  law.exponent = 3;
  std::fill(law.coefficients_pa.begin() + 1, law.coefficients_pa.end(), 0.0);
}
void neo_hookean(material::Material& material) {
  material.elastic_law = material::ElasticLaw::NeoHookean;
}

class ElementSetOfLaw : public ::testing::TestWithParam<Case> {
 protected:
  ElementSetOfLaw() : organ_(testing::block(3, 2, 2)) {
    GetParam().use(organ_.material);
    auto model = FullModel::create(organ_);
    TROCAR_ASSERT(model.ok());
    model_ = std::move(*model);
    std::vector<TetIndex> tets;
    for (std::uint32_t t = 0; t < organ_.mesh.tets.size(); ++t) tets.push_back(TetIndex(t));
    for (std::uint32_t n = 0; n < organ_.mesh.node_count(); ++n) nodes_.push_back(NodeIndex(n));
    set_ = reduction::ElementSet(organ_, tets, {}, nodes_);
    std::vector<reduction::BlockMatrix::Pair> pairs;
    set_.add_pairs(pairs);
    tangent_ = reduction::BlockMatrix(nodes_.size(), std::move(pairs));
  }

  // Bends, shears and stretches the block by about this much strain.
  std::vector<float> moves(double strain) const {
    std::vector<float> u;
    for (const auto& x : organ_.mesh.rest_positions)
      for (const double part : {0.3 * x.x + x.y - 40 * x.x * x.z, 0.5 * x.z - 30 * x.y * x.x,
                                x.x - 0.4 * x.y + 25 * x.y * x.y})
        u.push_back(static_cast<float>(strain * part));
    return u;
  }
  std::vector<float> forces(reduction::ForcePart part, const std::vector<float>& u) const {
    std::vector<float> f(u.size(), 0.0F);
    set_.add_forces(part, u, f);
    return f;
  }
  static Vector to_vector(const std::vector<float>& values) {
    return Eigen::Map<const Eigen::VectorXf>(values.data(),
                                             static_cast<Eigen::Index>(values.size()))
        .cast<double>();
  }

  organ::Organ organ_;
  std::unique_ptr<FullModel> model_;
  std::vector<NodeIndex> nodes_;
  reduction::ElementSet set_;
  reduction::BlockMatrix tangent_;
};

TEST_P(ElementSetOfLaw, ForcesAreThoseOfTheOffLineSolver) {
  for (const double strain : {1e-3, 0.05, 0.3}) {
    const auto u = moves(strain);
    const auto expected = model_->resistance(to_vector(u));
    ASSERT_TRUE(expected.has_value());
    EXPECT_LT((to_vector(forces(reduction::ForcePart::Whole, u)) - *expected).norm(),
              2e-5 * expected->norm())
        << strain;
  }
}

TEST_P(ElementSetOfLaw, NonlinearForcesAreTheWholeLessTheLinear) {
  const auto u = moves(0.1);
  const Vector linear = to_vector(forces(reduction::ForcePart::Whole, u)) -
                        to_vector(forces(reduction::ForcePart::Nonlinear, u));
  // The forces are those of all degrees of freedom, also those that the model holds.
  const auto half = moves(0.05);
  const Vector half_linear = to_vector(forces(reduction::ForcePart::Whole, half)) -
                             to_vector(forces(reduction::ForcePart::Nonlinear, half));
  EXPECT_LT((linear - 2 * half_linear).norm(), 1e-5 * linear.norm());
  const auto tangent = model_->rest_tangent();
  const auto& numbers = model_->free_of_dof();
  Vector held = to_vector(u), free(tangent.rows());
  std::vector<float> only_free = u;
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] < 0) only_free[dof] = 0;
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) free[numbers[dof]] = static_cast<double>(only_free[dof]);
  const Vector expected = tangent.selfadjointView<Eigen::Lower>() * free;
  const Vector whole = to_vector(forces(reduction::ForcePart::Whole, only_free)),
               rest = to_vector(forces(reduction::ForcePart::Nonlinear, only_free));
  for (std::size_t dof = 0; dof < numbers.size(); ++dof) {
    const auto i = static_cast<Eigen::Index>(dof);
    if (numbers[dof] < 0) continue;
    EXPECT_NEAR(whole[i] - rest[i], expected[numbers[dof]], 2e-5 * whole.norm());
  }
}

TEST_P(ElementSetOfLaw, TheTangentIsTheDerivativeOfTheForces) {
  const auto u = moves(0.2);
  tangent_.clear();
  set_.add_tangent(u, true, tangent_);
  // The differences are of the off-line solver's forces, which are those of double precision.
  const double h = 1e-7;
  double worst = 0, largest = 0;
  for (std::uint32_t column = 0; column < nodes_.size(); ++column)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vector more = to_vector(u), less = more;
      const auto dof = static_cast<Eigen::Index>(3 * column + axis);
      more[dof] += h, less[dof] -= h;
      const Vector slope = (*model_->resistance(more) - *model_->resistance(less)) / (2 * h);
      for (std::uint32_t row = 0; row < nodes_.size(); ++row) {
        const auto columns = tangent_.columns(row);
        const auto found = std::ranges::lower_bound(columns, column);
        const bool is_there = found != columns.end() && *found == column;
        for (std::size_t k = 0; k < 3; ++k) {
          const double expected = slope[static_cast<Eigen::Index>(3 * row + k)];
          const double is =
              is_there ? static_cast<double>(tangent_.blocks(
                             row)[static_cast<std::size_t>(found - columns.begin())][3 * k + axis])
                       : 0;
          worst = std::max(worst, std::abs(is - expected));
          largest = std::max(largest, std::abs(expected));
        }
      }
    }
  EXPECT_LT(worst, 1e-4 * largest);
}

TEST_P(ElementSetOfLaw, TheRestTangentIsTheLinearPart) {
  tangent_.clear();
  set_.add_rest_tangent(tangent_);
  const auto u = moves(0.1);
  const Vector expected = to_vector(forces(reduction::ForcePart::Whole, u)) -
                          to_vector(forces(reduction::ForcePart::Nonlinear, u));
  Vector is = Vector::Zero(expected.size());
  for (std::size_t row = 0; row < nodes_.size(); ++row)
    for (std::size_t i = 0; i < tangent_.columns(row).size(); ++i)
      for (std::size_t k = 0; k < 9; ++k)
        is[static_cast<Eigen::Index>(3 * row + k / 3)] +=
            static_cast<double>(tangent_.blocks(row)[i][k]) *
            static_cast<double>(u[3 * tangent_.columns(row)[i] + k % 3]);
  EXPECT_LT((is - expected).norm(), 1e-5 * expected.norm());
}

TEST_P(ElementSetOfLaw, WeightsMultiplyATetsForces) {
  const std::vector<TetIndex> tets{TetIndex(2), TetIndex(5), TetIndex(7)};
  const std::vector<float> weights{2, 3, 0.5F};
  const reduction::ElementSet weighted(organ_, tets, weights, nodes_);
  const auto u = moves(0.2);
  std::vector<float> is(u.size(), 0.0F);
  weighted.add_forces(reduction::ForcePart::Nonlinear, u, is);
  Vector expected = Vector::Zero(static_cast<Eigen::Index>(u.size()));
  for (std::size_t i = 0; i < tets.size(); ++i) {
    const reduction::ElementSet one(organ_, std::span(&tets[i], 1), {}, nodes_);
    std::vector<float> f(u.size(), 0.0F);
    one.add_forces(reduction::ForcePart::Nonlinear, u, f);
    expected += static_cast<double>(weights[i]) * to_vector(f);
  }
  EXPECT_LT((to_vector(is) - expected).norm(), 1e-5 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(Laws, ElementSetOfLaw,
                         ::testing::Values(Case{"Measured", measured},
                                           Case{"Exponential", exponential},
                                           Case{"NeoHookean", neo_hookean}),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace trocar::reduce
