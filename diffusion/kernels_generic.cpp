#include "diffusion/kernels.h"

namespace dofusion::kernels {
namespace {
#include "diffusion/kernels_impl.h"
}  // namespace

extern const Kernels k_generic;
const Kernels k_generic = {"generic",    matmul_bf16,   matmul_f32, pack_bf16,       round_bf16, pair_rows, nearest,
                           edge_forward, edge_backward, column_max, column_sum_bf16, axpy,       axpy_bf16};

}  // namespace dofusion::kernels
