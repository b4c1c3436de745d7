/* Every function of FMI 2.0 as one that fails; linked to an FMU that defines those that it has. */

#include "fmi2FunctionTypes.h"

#define NOT_THERE(name)                                                                                      \
    __attribute__((visibility("default"), weak)) fmi2Status name(fmi2Component p) { return fmi2Error; }
#define VALUES(type) NOT_THERE(fmi2Get##type) NOT_THERE(fmi2Set##type)

VALUES(Real) VALUES(Integer) VALUES(Boolean) VALUES(String) VALUES(FMUstate)
NOT_THERE(fmi2SetDebugLogging) NOT_THERE(fmi2SetupExperiment) NOT_THERE(fmi2EnterInitializationMode)
NOT_THERE(fmi2ExitInitializationMode) NOT_THERE(fmi2Terminate) NOT_THERE(fmi2Reset) NOT_THERE(fmi2FreeFMUstate)
NOT_THERE(fmi2SerializedFMUstateSize) NOT_THERE(fmi2SerializeFMUstate) NOT_THERE(fmi2DeSerializeFMUstate)
NOT_THERE(fmi2GetDirectionalDerivative) NOT_THERE(fmi2SetRealInputDerivatives)
NOT_THERE(fmi2GetRealOutputDerivatives) NOT_THERE(fmi2DoStep) NOT_THERE(fmi2CancelStep)
NOT_THERE(fmi2GetStatus) NOT_THERE(fmi2GetRealStatus) NOT_THERE(fmi2GetIntegerStatus)
NOT_THERE(fmi2GetBooleanStatus) NOT_THERE(fmi2GetStringStatus) NOT_THERE(fmi2EnterEventMode)
NOT_THERE(fmi2NewDiscreteStates) NOT_THERE(fmi2EnterContinuousTimeMode) NOT_THERE(fmi2CompletedIntegratorStep)
NOT_THERE(fmi2SetTime) NOT_THERE(fmi2SetContinuousStates) NOT_THERE(fmi2GetDerivatives)
NOT_THERE(fmi2GetEventIndicators) NOT_THERE(fmi2GetContinuousStates)
NOT_THERE(fmi2GetNominalsOfContinuousStates)

#define TEXT(name, text) __attribute__((visibility("default"), weak)) const char *name(void) { return text; }
TEXT(fmi2GetTypesPlatform, "default") TEXT(fmi2GetVersion, "2.0")
