/* Principal stretches and directions of F = I + H: F = U diag(s) Vᵀ, U and V rotations.
 *
 * The sign of an inverted F is on the smallest stretch (the rotation variant of the singular value
 * decomposition). In plane strain the third direction stays e₃ and its stretch one.
 */
struct frame
{
  lanes U[3][3], V[3][3]; /* [n][i]: component i of direction n */
  lanes s[3], e[3];       /* stretches, and stretches less one without cancellation at small H */
  mask small;             /* where e is more exact than s */
};

#if DIM == 2
#include "frame_plane.h"
#else
#include "frame_solid.h"
#endif
